"""The learned rows of ``nanobench sysid --learned all``: trained, or found again in checkpoints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from ..steps.options import Options

if TYPE_CHECKING:
    from ..methods import Predictor
    from ..physics import Vehicle
    from ..protocols.task1 import Case, PredictionRow


def checkpoint_folder(options: Options) -> Path:
    """Where trainings are kept: below ``--out``, else in the cache folder of the user."""
    from ..results.cache_folder import cache_folder

    return (options.out or cache_folder()) / "learned"


def learned_predictors(options: Options, train: Sequence[Case], physics: Mapping[str, Predictor], epochs: int,
                       vehicle: Vehicle, published: bool = True) -> list[Any]:
    """Predictors trained on ``train``, the ``published`` ones too or our own alone; ``physics``: the models fitted to
    it, by name. Failures are kept in ``options``.
    MissingExtraError without JAX, InputError without training flights."""
    from identification.learned.learned_study import Wanted, trained_rows
    from identification.learned.libraries import libraries

    from ..harness import make_item

    libraries()

    def fits(rung: str, sets: Sequence[Sequence[Case]]) -> list[Any]:
        from identification.greybox.ablation_study import fit_item, predictor_of, rungs

        place = train[0].flight.provenance.path
        items = [make_item(fit_item, {"cases": list(cases), "rung": rungs([rung])[0], "seed": options.seed,
                                      "vehicle": vehicle}, f"fit {rung}, some flights held out", file=place)
                 for cases in sets]
        values = options.run(items, "fit").values
        if any(item.key not in values for item in items):
            raise InputError(place, f"{rung} could not be fitted without some flights", "see the failure above")
        return [predictor_of(values[item.key]) for item in items]

    chosen = Wanted(epochs=epochs, published=published, seed=options.seed)
    found, failed = trained_rows(train, chosen, checkpoint_folder(options), physics, fits, options.quiet, options.say,
                                 options.jobs)
    options.failed += failed
    return found


def draw(options: Options, rows: Sequence[PredictionRow], learned: Sequence[Any], predictors: Sequence[Any],
         test: Sequence[Case]) -> None:
    """learned.html in ``--out``: errors against the horizon, learning curves, paths of a held-out helix."""
    if options.out is None or not learned:
        return
    from identification.learned.learning_pictures import horizon_figure, learning_figure, path_figure, write_page

    fits = [p for p in predictors if p.name in ("published_physics", "fit_balanced")]
    path = options.out / "learned.html"
    write_page(path, [horizon_figure(rows), learning_figure({p.name: p.trained.history for p in learned}),
                      path_figure(test, [*fits, *(p for p in learned if not p.name.endswith("_voltage"))])],
               options.synthetic)
    options.say(f"pictures in {path}")
