"""The scores of an engine in tables: by term, by size, by vehicle; exact binomial intervals."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from identification.prove.summary import Share, Spread
from nanobench_tools.results.result import Result

from .case_score import CorruptedScore


@dataclass(frozen=True, repr=False)
class Rates(Result):
    """Counts of cases, of visible singles, pairs and outside shapes that are identified, and of cases with a false
    effect. Also parameters inside their 95 % interval, and the share of the improvement that the nominal simulator
    reaches, of visible cases."""

    cases: int
    identified: Share
    false: Share
    covered: Share
    improvement: Spread

    @classmethod
    def of(cls, scores: Iterable[CorruptedScore]) -> Rates:
        """Of some cases."""
        found = list(scores)
        seen = [s for s in found if s.visible]
        return cls(len(found), Share.of(s.identified for s in seen), Share.of(bool(s.false) for s in found
                                                                             if s.kind != "control"),
                   Share.of(i.covered for s in found for i in s.intervals),
                   Spread.of([s.share for s in seen if s.share is not None]))


@dataclass(frozen=True, repr=False)
class CorruptedProof(Result):
    """corrupted.json. by_belief, by_size (size over the smallest that predictions show), by_vehicle, by_kind;
    ``controls``: effects identified with each nominal simulator; ``calibration``: [stated confidence, share right,
    findings]."""

    engine: str
    seed: int
    all: Rates
    by_kind: Mapping[str, Rates]
    by_vehicle: Mapping[str, Rates]
    by_size: Mapping[str, Rates]
    by_belief: Mapping[str, Rates]
    controls: Mapping[str, tuple[str, ...]]
    calibration: tuple[tuple[float, float, int], ...]
    cases: tuple[CorruptedScore, ...]

    @classmethod
    def of(cls, engine: str, seed: int, scores: Sequence[CorruptedScore]) -> CorruptedProof:
        """Of all scores of an engine."""
        singles = [s for s in scores if s.kind == "single"]
        named = [s for s in scores if s.kind in ("single", "outside")]
        return cls(engine, seed, Rates.of(scores), _by(scores, lambda s: s.kind), _by(scores, lambda s: s.vehicle),
                   _by(singles, lambda s: f"{s.times:g}" if s.times else "not shown"), _by(named, lambda s: s.belief),
                   {f"{s.vehicle}/{s.group}": s.named or (s.outcome,) for s in scores if s.kind == "control"},
                   _calibration(scores), tuple(scores))


EDGES = (0.0, 0.6, 0.7, 0.8, 0.9, 0.95, 1.0)
"""Of groups of stated confidence."""


def _by(scores: Iterable[CorruptedScore], of: Callable[[CorruptedScore], str]) -> dict[str, Rates]:
    found: dict[str, list[CorruptedScore]] = {}
    for s in scores:
        found.setdefault(of(s), []).append(s)
    return {name: Rates.of(mine) for name, mine in sorted(found.items(), key=lambda pair: _order(pair[0]))}


def _order(name: str) -> tuple[float, str]:
    return (float(name), "") if name.replace(".", "").isdigit() else (np.inf, name)


def _calibration(scores: Sequence[CorruptedScore]) -> tuple[tuple[float, float, int], ...]:
    stated = [pair for s in scores if s.kind != "control" for pair in s.confidence]
    found = []
    for low, high in pairwise(EDGES):
        inside = [(c, ok) for c, ok in stated if low < c <= high]
        if inside:
            found.append((float(np.mean([c for c, _ in inside])), float(np.mean([ok for _, ok in inside])),
                          len(inside)))
    return tuple(found)


HEADS = ("", "cases", "visible identified", "false effects", "sizes in 95 %", "improvement")


def rows(named: Mapping[str, Rates]) -> list[tuple[str, ...]]:
    """Of a table with HEADS."""
    return [(name, str(r.cases), _share(r.identified), _share(r.false), _share(r.covered),
             "-" if r.improvement.median is None else f"{r.improvement.median:.0%}") for name, r in named.items()]


def _share(found: Share) -> str:
    """``12 of 15 [52, 96]``; ``-`` for no case."""
    if found.ci95 is None:
        return "-"
    low, high = found.ci95
    return f"{found.right} of {found.n} [{100 * low:.0f}, {100 * high:.0f}]"
