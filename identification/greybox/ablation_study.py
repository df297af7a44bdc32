"""The ablation as items of the runner: fits that are found again, and predictors made from what they gave."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, cast

import numpy as np

from identification.vehicle.vehicle_fit import fit_vehicle
from identification.vehicle.vehicle_priors import PriorsFile
from nanobench_tools.methods import Predictor
from nanobench_tools.physics import Vehicle
from nanobench_tools.physics.hover import doubts
from nanobench_tools.protocols.completed import additions
from nanobench_tools.protocols.sessions import sessions_of
from nanobench_tools.protocols.task1 import Case, WindowErrors, score
from nanobench_tools.results.result import OPTIONAL, Result

from .fit import GreyBox, nuisances_of
from .fit_result import FitResult
from .fit_windows import MOST_WINDOWS, cut
from .fitted_predictor import GreyBoxPredictor
from .flyability import flies
from .ladder import LADDER, Rung

SHORT = ("fit_thrust_voltage", "fit_balanced", "fit_observed", "fit_vehicle")
"""The rungs of the main job."""
HELD_OUT_WINDOWS = 600
"""A fit that only ranks models takes about so many windows: half of what a fit takes that is shown."""

Terms = Mapping[str, Mapping[str, Any]]
"""{term: {parameter: number, or list of numbers}}"""
PHYSICAL_NOTE = ("The exported file has the mean trim of the training flights. Without a controller, a slightly "
                 "different trim turns it over within half a second, as it turns the real one: compare it in closed "
                 "loop")
GIVEN = ("mass {mass_g:.4g} g, {arm_mm:.3g} mm from the centre to each motor, motor order and turning directions: "
         "flights do not show them")
NOTES = {"none": "",
         "inputs": "It keeps the mean thrust and trim of the training flights. The row it is made from sets both and "
                   "the tilt. It corrects rate and rotors at the start, from the half second of inputs before each "
                   "window",
         "past": "It keeps the mean thrust and trim of the training flights. The row it is made from learns them and "
                 "the tilt. It also learns corrections of rate and rotors at the start, from the two seconds before "
                 "each window"}


def rungs(names: Sequence[str] | None = None) -> list[Rung]:
    """The rungs named, or all."""
    return [rung for rung in LADDER if names is None or rung.name in names]


@dataclass(frozen=True, repr=False)
class Gains(Result):
    """Learned parameters for starts of one kind: as of ``GreyBoxPredictor``."""

    gains: np.ndarray | None


@dataclass(frozen=True, repr=False)
class Made(Result):
    """What a ``GreyBoxPredictor`` is made from."""

    terms: Terms
    gains: np.ndarray | None
    scale: np.ndarray | None
    adapt: str
    vehicle: Vehicle


@dataclass(frozen=True, repr=False)
class FittedRung(Result):
    """One rung fitted. ``simulator``: terms of the vehicle that is the same in every window; ``uses``: its sentence;
    ``backward``: per-window values learned for starts that look back only, if requested (None without per-window
    values); ``physical``: as of ``Rung``."""

    predictor: Made
    simulator: Terms
    simulator_note: str
    result: FitResult
    summary: str
    uses: str
    backward: Gains | None = field(default=None, metadata=OPTIONAL)
    physical: bool = False


def fit_item(cases: Sequence[Case], rung: Rung, seed: int, vehicle: Vehicle,
             priors: PriorsFile | None = None) -> FittedRung:
    """One rung fitted to ``cases``."""
    return fit_together(cases, [rung], seed, vehicle, priors=priors)[rung.name]


def fit_together(cases: Sequence[Case], rungs: Sequence[Rung], seed: int, vehicle: Vehicle,
                 windows: int = MOST_WINDOWS, backward: bool = False, judged: bool = True,
                 sessions: Mapping[str, int] | None = None, priors: PriorsFile | None = None) -> dict[str, FittedRung]:
    """``fit_item``, by name, of rungs with the same terms, which differ in what is set per window.

    Their parameters are searched once. ``windows``: about how many are fitted to. ``judged``, ``sessions``: as of
    ``GreyBox``. ``backward``: per-window values are also learned for starts that look back only. ``priors``: the
    user's file, for a physical vehicle.
    """
    found: dict[str, FittedRung] = {}
    first: GreyBox | None = None
    sessions = sessions or sessions_of([case.flight for case in cases])
    for rung in rungs:
        if rung.physical:
            found[rung.name] = _physical(cases, rung, vehicle, seed, windows, backward, priors)
            continue
        model = GreyBox(rung.terms, vehicle=vehicle, adapt=rung.adapt, name=rung.name, seed=seed, hold=rung.hold,
                        judged=judged, sessions=sessions)
        model.fit_cuts(cut(cases, past=rung.adapt == "past", most=windows), first)
        first = first or model
        gains = _backward(cases, rung, model) if backward and rung.adapt != "none" else None
        found[rung.name] = _found(rung, model, gains)
    return found


def _physical(cases: Sequence[Case], rung: Rung, vehicle: Vehicle, seed: int, windows: int, backward: bool,
              priors: PriorsFile | None) -> FittedRung:
    """The vehicle of ``cases``, and what it sets per window. Sessions are those of ``cases`` alone, so that it depends
    on these flights only."""
    sessions = sessions_of([case.flight for case in cases])
    fitted = fit_vehicle(cases, vehicle, seed, sessions, priors)
    terms = fitted.model.as_dict()
    model = GreyBox(terms, vehicle=vehicle, adapt=rung.adapt, name=rung.name, seed=seed, hold=tuple(terms),
                    judged=False, sessions=sessions).fit_cuts(cut(cases, most=windows))
    flown = flies(fitted.model, model.data_)
    wrong = [*([] if flown.flies else [f"does not fly: {flown}"]), *doubts(fitted.model)]
    added = additions([case.flight for case in cases])
    arm_mm = 1e3 * float(np.mean(np.linalg.norm(vehicle.motor_positions_m, axis=1)))
    model.model_, model.parameters_ = fitted.model, dict(fitted.parameters)
    model.result_ = replace(model.result_, parameters=fitted.parameters, flown=flown, trouble="; ".join(wrong),
                            not_identified=fitted.notes, priors=fitted.priors,
                            assumed=(GIVEN.format(mass_g=1e3 * vehicle.mass_kg, arm_mm=arm_mm), *added),
                            thrust_spread=fitted.thrust_spread, nuisances=(), n_flights=fitted.flights, steps=0,
                            cost=0.0)
    model.predictor_ = replace(model.predictor_, parameters=fitted.parameters)
    found = _found(rung, model, _backward(cases, rung, model) if backward else None)
    apart = f"single flights differ in thrust by {100.0 * fitted.thrust_spread:.1f} % (standard deviation)"
    said = (text[0].upper() + text[1:] for text in (*added, *fitted.notes, apart))
    return replace(found, simulator_note=". ".join((found.simulator_note, *said)))


def held_out_item(cases: Sequence[Case], others: Sequence[Case], rungs: Sequence[Rung], seed: int,
                  vehicle: Vehicle, priors: PriorsFile | None = None) -> dict[str, list[WindowErrors]]:
    """{rung: [score of each of ``others``]} of rungs with the same terms, fitted to ``cases``; onboard truth."""
    fitted = fit_together(cases, rungs, seed, vehicle, HELD_OUT_WINDOWS, judged=False, priors=priors)
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


def _backward(cases: Sequence[Case], rung: Rung, model: GreyBox) -> Gains:
    """Gains learnt from starts that look back only, at the parameters of ``model``. With training flights held out in
    turn this lowers the criterion of ``choice`` by 1 to 3 %. Searching the parameters again lowers it no further."""
    again = replace(model, judged=False)
    again.fit_cuts(cut(cases, past=rung.adapt == "past", start="past"), model)
    return Gains(again.predictor_.gains)


def _found(rung: Rung, model: GreyBox, backward: Gains | None) -> FittedRung:
    made = model.predictor_
    return FittedRung(Made(made.terms, made.gains, made.scale, made.adapt, model.vehicle), model.model_.as_dict(),
                      PHYSICAL_NOTE if rung.physical else NOTES[rung.adapt], model.result_, model.result_.summary(),
                      rung.sentence, backward, rung.physical)


def predictor_of(fitted: FittedRung, start: str = "centred") -> GreyBoxPredictor:
    """The predictor of a rung; for starts of class ``past`` with what was learnt from such, if anything was."""
    made, result = fitted.predictor, fitted.result
    gains = fitted.backward.gains if start == "past" and fitted.backward is not None else made.gains
    terms = {term: {k: tuple(v) if isinstance(v, list) else v for k, v in values.items()}
             for term, values in made.terms.items()}
    return GreyBoxPredictor(result.name, terms, made.vehicle, made.adapt, gains, made.scale,
                            result.parameters, () if gains is None else nuisances_of(made.adapt))
