"""The models of ``nanobench sysid``: fitted to training flights, the best of them chosen there, one exported."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import NanobenchError, how_to_install
from ..steps.options import Options
from .convert import SIMULATORS, export_simulators

if TYPE_CHECKING:
    from identification.greybox.ablation_study import FittedRung
    from identification.vehicle.vehicle_priors import PriorsFile

    from ..physics import Model, Vehicle
    from ..protocols.choice import ChosenOn
    from ..protocols.task1 import Case, WindowErrors

SIMULATOR = "simulator.toml"
TRIMMED = "simulator.toml + trim"
"""The exported vehicle with four gains of the motors from the rows before each start."""
Fits = Mapping[str, tuple[Any, "FittedRung"]]
"""(predictor, what the fit gave) by name."""


Scores = Mapping[str, Sequence["WindowErrors"]]
"""Scores of whole flights by name of the model."""


def fitted(options: Options, train: Sequence[Case], wanted: str, vehicle: Vehicle,
           priors: PriorsFile | None = None) -> tuple[dict[str, tuple[Any, FittedRung]], Scores]:
    """((predictor, what the fit gave) by name, scores of models of class ``state`` on training flights that were held
    out in turn); ``wanted``: all, short or none. Empty, and said why, without CasADi or training flights."""
    from ..harness import make_item
    from ..protocols import choice

    if wanted == "none":
        return {}, {}
    if importlib.util.find_spec("casadi") is None:
        options.say(f"no model is fitted: casadi is not installed; {how_to_install('identification')}")
        return {}, {}
    if not train:
        options.say("no model is fitted: no training flight can be used")
        return {}, {}
    from identification.greybox.ablation_study import SHORT, alike, fit_together, held_out_item, predictor_of, rungs

    chosen = rungs(None if wanted == "all" else SHORT)
    place, shared = train[0].flight.provenance.path, {"seed": options.seed, "vehicle": vehicle, "priors": priors}
    sessions = options.sessions.by_name(case.flight for case in train)
    items = [make_item(fit_together, {"cases": list(train), "rungs": lot, **shared, "backward": True,
                                      "sessions": sessions},
                       f"fit {' and '.join(rung.name for rung in lot)}", file=place)
             for lot in sorted(alike(chosen), key=len, reverse=True)]
    again = [make_item(held_out_item, {"cases": rest, "others": left_out, "rungs": lot, **shared},
                       f"fit {' and '.join(rung.name for rung in lot)}, group {number} held out", file=place)
             for lot in alike([rung for rung in chosen if rung.adapt != "past"])
             for number, (rest, left_out) in enumerate(choice.held_out(train), 1)]
    values = options.run([*items, *again], "fit").values  # the longest first; the others fill the remaining cores
    found = {name: value for item in items if item.key in values for name, value in values[item.key].items()}
    scores: dict[str, list[WindowErrors]] = {}
    for item in again:
        for name, mine in values.get(item.key, {}).items():
            scores.setdefault(name, []).extend(mine)
    return {rung.name: (predictor_of(found[rung.name]), found[rung.name])
            for rung in chosen if rung.name in found}, scores


@dataclass(frozen=True)
class Choice:
    """The chosen models. Field best is the name of the best model of class ``state``. Field exported is the physical
    vehicle, or the best fitted one if there is no vehicle.

    ``scores`` is {model: criterion} on training ``cases``, held out where a model is fitted to them."""

    best: str | None
    exported: str | None
    cases: Sequence[Case]
    scores: Mapping[str, float | None]

    def chosen_on(self, not_considered: Sequence[str] = ()) -> ChosenOn:
        """``best_chosen_on`` of the result."""
        from ..protocols import choice

        return choice.reported(self.cases, self.scores, not_considered)


def choose(options: Options, train: Sequence[Case], predictors: Sequence[Any], fits: Fits, held_out: Scores) -> Choice:
    """The best model of class ``state`` by whole training flights held out in turn (``held_out`` of ``fitted``). Test
    flights take no part. Fits that are no result, and ``predictors`` that fail on a flight, are never the best."""
    from ..harness import make_item
    from ..protocols import choice, task1

    plain = [p for p in predictors if p.information == "state"]
    good = [name for name, (p, value) in fits.items() if p.information == "state" and value.result.is_result]
    as_they_are = [(p.name, make_item(task1.score, {"case": case, "predictor": p, "truth": "onboard"},
                                      f"{p.name} {case.flight.name}, for the choice", file=case.flight.provenance.path))
                   for p in plain for case in train]
    values = options.run([item for _, item in as_they_are], "choose").values
    found: dict[str, list[WindowErrors]] = {p.name: [] for p in plain}
    found |= {name: list(held_out.get(name, ())) for name in good}
    for name, item in as_they_are:
        found[name] += [values[item.key]] if item.key in values else []
    scores = {name: choice.criterion(mine) if len(mine) == len(train) else None for name, mine in found.items()}
    vehicle = next((name for name in good if fits[name][1].physical), None)
    return Choice(choice.best_of(scores), vehicle or choice.best_of({name: scores[name] for name in good}), train,
                  scores)


@dataclass(frozen=True)
class Exported:
    """path: of the simulator file, None without a folder. predictors: the exported model alone, and a physical vehicle
    also with the trim of each flight."""

    path: str | None = None
    predictors: list[Any] = field(default_factory=list)


def exported(options: Options, fits: Fits, best: str | None, name: str) -> Exported:
    """The best fitted model as file ``name`` in ``--out``, or next to the file of ``--json``. A folder next to it has
    the files for other simulators. Read back, the model is a predictor called SIMULATOR. Its trim is the mean of the
    training flights."""
    if best is None or best not in fits:
        return Exported()
    from ..physics import Model
    from ..physics.simulator import dumps, loads, read_simulator, write_simulator

    predictor, value = fits[best]
    model = Model(predictor.vehicle, value.simulator)
    beside = options.json.parent if options.json is not None and str(options.json) != "-" else None
    folder = options.out or beside
    if folder is None:
        return Exported(None, _alone(loads(dumps(model)), value))
    folder.mkdir(parents=True, exist_ok=True)
    write_simulator(model, folder / name, value.result.remarks)
    _write_others(options, model, folder, name)
    return Exported(str(folder / name), _alone(read_simulator(folder / name), value))


def _alone(model: Model, fitted: FittedRung) -> list[Any]:
    """Predictors of the exported ``model``, without what the fit sets per window."""
    from ..physics.predictor import ModelPredictor

    if not fitted.physical:
        return [ModelPredictor(model, SIMULATOR)]
    from identification.vehicle.trimmed_predictor import TrimmedPredictor

    return [ModelPredictor(model, SIMULATOR), TrimmedPredictor(model, TRIMMED)]


def _write_others(options: Options, model: Model, folder: Path, name: str) -> None:
    others = folder / Path(name).stem.replace("simulator", "simulators", 1)
    for target in SIMULATORS:
        try:
            export_simulators(model, others, (target,))
        except NanobenchError as error:  # a model that this one cannot take is still a result
            options.say(f"not written for {target}: {error}")
    options.say(f"{folder / name}, and for {', '.join(SIMULATORS)} in {others}")
