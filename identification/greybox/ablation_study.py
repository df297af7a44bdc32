"""The ablation as items of the runner: fits that are found again, and predictors made from what they gave."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np

from nanobench_tools.methods import Predictor
from nanobench_tools.physics import Vehicle
from nanobench_tools.protocols.sessions import sessions_of
from nanobench_tools.protocols.task1 import Case, score

from .fit import GreyBox, nuisances_of
from .fit_windows import MOST_WINDOWS, cut
from .fitted_predictor import GreyBoxPredictor
from .ladder import LADDER, Rung

SHORT = ("fit_thrust_voltage", "fit_balanced", "fit_observed")
"""The rungs of the main job."""
HELD_OUT_WINDOWS = 600
"""A fit that only ranks models takes about so many windows: half of what a fit takes that is shown."""


NOTES = {"none": "",
         "inputs": "It holds the mean thrust and trim of the training flights; the row it is made from sets both, the "
                   "tilt, and corrects rate and rotors at the start, from the half second of inputs before each window",
         "past": "It holds the mean thrust and trim of the training flights; the row it is made from learns them, the "
                 "tilt, and corrections of rate and rotors at the start, from the two seconds before each window"}


def rungs(names: Sequence[str] | None = None) -> list[Rung]:
    """The rungs named, or all."""
    return [rung for rung in LADDER if names is None or rung.name in names]


def fit_item(cases: Sequence[Case], rung: Rung, seed: int, mass_kg: float) -> dict[str, Any]:
    """{predictor, result} of one rung fitted to ``cases``, as plain JSON values."""
    return fit_together(cases, [rung], seed, mass_kg)[rung.name]


def fit_together(cases: Sequence[Case], rungs: Sequence[Rung], seed: int, mass_kg: float,
                 windows: int = MOST_WINDOWS, backward: bool = False, judged: bool = True,
                 sessions: Mapping[str, int] | None = None) -> dict[str, dict[str, Any]]:
    """``fit_item``, by name, of rungs with the same terms, which differ in what is set per window: their parameters
    are searched once. ``windows``: about how many are fitted to. judged, sessions: as of ``GreyBox``. backward: what is
    set per window is also learnt for starts that look back only, as ``backward`` (gains and their ridge; None where
    nothing is set)."""
    vehicle = Vehicle(mass_kg=mass_kg)
    found: dict[str, dict[str, Any]] = {}
    first: GreyBox | None = None
    for rung in rungs:
        model = GreyBox(rung.terms, vehicle=vehicle, adapt=rung.adapt, name=rung.name, seed=seed, hold=rung.hold,
                        judged=judged, sessions=sessions or sessions_of([case.flight for case in cases]))
        model.fit_cuts(cut(cases, past=rung.adapt == "past", most=windows), first)
        first = first or model
        found[rung.name] = _found(rung, model, mass_kg)
        if backward:
            found[rung.name]["backward"] = None if rung.adapt == "none" else _backward(cases, rung, model)
    return found


def held_out_item(cases: Sequence[Case], others: Sequence[Case], rungs: Sequence[Rung], seed: int,
                  mass_kg: float) -> dict[str, list[dict[str, Any]]]:
    """{rung: [score of each of ``others``]} of rungs with the same terms, fitted to ``cases``; onboard truth."""
    fitted = fit_together(cases, rungs, seed, mass_kg, HELD_OUT_WINDOWS, judged=False)
    predictors = {name: predictor_of(value) for name, value in fitted.items()}
    return {name: [score(case, cast("Predictor", predictor), "onboard") for case in others]
            for name, predictor in predictors.items()}


def alike(rungs: Sequence[Rung]) -> list[list[Rung]]:
    """Rungs that may be fitted together, in the order of the first of each lot."""
    lots: list[list[Rung]] = []
    for rung in rungs:
        for lot in lots:
            if lot[0].terms == rung.terms and lot[0].hold == rung.hold and "none" not in (lot[0].adapt, rung.adapt):
                lot.append(rung)
                break
        else:
            lots.append([rung])
    return lots


def _backward(cases: Sequence[Case], rung: Rung, model: GreyBox) -> dict[str, Any]:
    """Gains learnt from starts that look back only, at the parameters of ``model``. With training flights held out in
    turn that lowers the criterion of ``choice`` by 1 to 3 %; searching the parameters again lowers it no further."""
    again = replace(model, judged=False)
    again.fit_cuts(cut(cases, past=rung.adapt == "past", start="past"), model)
    return {"gains": _plain(again.predictor_.gains)}


def _found(rung: Rung, model: GreyBox, mass_kg: float) -> dict[str, Any]:
    made = model.predictor_
    return {"predictor": {"terms": {term: {k: _plain(v) for k, v in values.items()}
                                    for term, values in made.terms.items()},
                          "gains": _plain(made.gains), "scale": _plain(made.scale), "adapt": made.adapt,
                          "mass_kg": mass_kg},
            "simulator": {term: {k: _plain(v) for k, v in values.items()}
                          for term, values in model.model_.as_dict().items()},
            "simulator_note": NOTES[rung.adapt], "result": model.result_.to_json(),
            "summary": model.result_.summary(), "uses": rung.sentence}


def predictor_of(value: Mapping[str, Any], start: str = "centred") -> GreyBoxPredictor:
    """The predictor of a ``fit_item``; for starts of class ``past`` with what was learnt from such, if anything was."""
    made, result = value["predictor"], value["result"]
    if start == "past" and value.get("backward"):
        made = {**made, **value["backward"]}
    gains, scale = (None if made[key] is None else np.array(made[key]) for key in ("gains", "scale"))
    terms = {term: {k: tuple(v) if isinstance(v, list) else v for k, v in values.items()}
             for term, values in made["terms"].items()}
    return GreyBoxPredictor(result["name"], terms, Vehicle(mass_kg=made["mass_kg"]), made["adapt"], gains, scale,
                            result["parameters"], () if gains is None else nuisances_of(made["adapt"]))


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    return list(value) if isinstance(value, tuple) else value
