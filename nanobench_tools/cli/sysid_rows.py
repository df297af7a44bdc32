"""The rows of ``nanobench sysid``: every model from the published start, and from a start that looks back only."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ..steps.options import Options
from .sysid_models import Fits

if TYPE_CHECKING:
    from ..protocols.task1 import Case, PredictionRow

KINDS = (("onboard", "centred"), ("mocap", "centred"), ("onboard", "past"))
"""(truth, start) that every model is scored with."""
Scored = Mapping[tuple[str, str], Sequence[tuple["Case", Any]]]
"""(case, score) by (model, truth)."""


def rows_of(options: Options, predictors: Sequence[Any], fits: Fits, test: Sequence[Case],
            best: str | None) -> tuple[list[PredictionRow], Scored]:
    """(rows, those with the published start before those that look back; scores from the published start). Rows of one
    start are compared with the model ``best`` from the same."""
    from ..harness import make_item
    from ..protocols import compare, task1

    work = [(predictor, truth, start, case) for truth, start in KINDS for predictor in predictors for case in test]
    used = {(p.name, start): _for(p, start, fits) for p in predictors for _, start in KINDS}
    items = [make_item(task1.score, {"case": case, "predictor": used[p.name, start], "truth": truth, "start": start},
                       f"{p.name} {truth}{', start from the past' * (start == 'past')} {case.flight.name}",
                       file=case.flight.provenance.path) for p, truth, start, case in work]
    values = options.run(items, "sysid").values
    scored: dict[str, dict[tuple[str, str], list[tuple[Case, Any]]]] = {start: {} for _, start in KINDS}
    for (predictor, truth, start, case), item in zip(work, items, strict=True):
        mine = scored[start].setdefault((predictor.name, truth), [])
        if item.key in values:
            mine.append((case, values[item.key]))
    rows: list[PredictionRow] = []
    for start, found in scored.items():
        made = [row for predictor in predictors for truth, kind in KINDS if kind == start
                for row in task1.tabulate(predictor, truth, found[predictor.name, truth], options.seed,
                                          options.sessions, start)]
        rows += compare.predictions(made, found, best, options.sessions, options.seed)
    return rows, scored["centred"]


def _for(predictor: Any, start: str, fits: Fits) -> Any:
    """The predictor from such a start: what a fit sets per window was learnt from starts of the same kind."""
    if start == "centred" or predictor.name not in fits:
        return predictor
    from identification.greybox.ablation_study import predictor_of

    return predictor_of(fits[predictor.name][1], start)
