"""A grey-box model with the habits of scikit-learn: settings in ``__init__``, ``fit`` returns self, learnt values end
with an underscore."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, cast

import numpy as np

from nanobench_tools.errors import UsageError
from nanobench_tools.flight import Flight
from nanobench_tools.methods import Prediction, Windows
from nanobench_tools.metrics.statistics import UNKNOWN, why_not
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.physics.fit_bounds import bounds
from nanobench_tools.physics.model import find_term, typical
from nanobench_tools.protocols.sessions import sessions_of
from nanobench_tools.protocols.task1 import Case
from nanobench_tools.results.fitted_values import Estimate
from nanobench_tools.settings import number

from .arrays import FitWindows
from .fit_result import FitResult
from .fit_windows import Cut, cases_of, cut, gather, mean_errors
from .fitted_predictor import GreyBoxPredictor
from .flyability import Flight as Flown
from .flyability import flies
from .ladder import FULL, HEAVY, Terms
from .nuisance import SCALE, STARTS, TILT, TRIMS, terms_of
from .parameter_intervals import FEWEST_FLIGHTS, bootstrap, not_identified, profile
from .ranges import falling_thrust, held, priors
from .solve import Nuisance, Prior, Problem, Solution, solve, usual_errors
from .symmetry import joined
from .window_gains import learn_gains

ADAPTS = ("none", "inputs", "past")
INDEPENDENT_S = number("greybox.fit.independent_s")
EVERY_S = 0.1
"""Windows of Task 1 start this far apart."""


@dataclass
class GreyBox:
    """A model of physical ``terms`` (names, or names with values to start from), fitted to what it predicts.

    adapt: ``none``, a model of constant parameters; ``inputs``: thrust, trim, tilt and corrections of the start of
    each window follow from the inputs of the half second before it. These models have class ``state``; ``past``: from
    all streams of the two seconds before (class ``past``). vehicle: what scale and ruler say. Nuisances of training
    flights are used only where ``adapt`` is not ``none``; a test flight never has any.
    - seed: of the bootstrap.
    - soft: priors in place of those for the same parameters.
    - hold: terms that are not fitted.
    - judged: with intervals, parameters that the flights do not identify, and whether the model flies; a fit that only
      predicts needs none of them.
    - sessions {flight: label}: intervals draw sessions, then flights within them; without it ``fit`` finds them by the
      flights' dates.

    >>> GreyBox(terms=["thrust_voltage", "motor_lag", "drag_linear"]).terms["motor_lag"]
    {'tau_up_s': 0.03, 'tau_down_s': 0.04}
    """

    terms: Mapping[str, Mapping[str, Any]] | Sequence[str] = field(default_factory=lambda: FULL)
    vehicle: Vehicle = field(default_factory=Vehicle)
    adapt: str = "none"
    name: str = "greybox"
    seed: int = 0
    threads: int = 1
    progress: Any = None
    soft: tuple[Prior, ...] = ()
    hold: tuple[str, ...] = ()
    judged: bool = True
    sessions: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.adapt not in ADAPTS:
            raise UsageError(f"adapt is {self.adapt!r}; it can be {', '.join(ADAPTS)}")
        if not isinstance(self.terms, Mapping):
            self.terms = {name: typical(find_term(name), self.vehicle.rotors) for name in self.terms}

    @property
    def information(self) -> str:
        return "past" if self.adapt == "past" else "state"

    def fit(self, flights: Sequence[Flight | Case]) -> GreyBox:
        """Fit to whole flights (or the cases of a protocol). Raises InputError if they are uninformative."""
        cases = _cases(flights)
        if not self.sessions:
            self.sessions = sessions_of([case.flight for case in cases])
        return self.fit_cuts(cut(cases, past=self.adapt == "past"))

    def fit_cuts(self, cuts: Sequence[Cut], like: GreyBox | None = None) -> GreyBox:
        """The same from existing windows. ``like``: a model with the same terms that was fitted to the same windows.
        Its parameters are reused, and only the per-window values are learned again."""
        data = gather(cuts)
        nuisances = () if self.adapt == "none" else (SCALE, *TRIMS)
        model = Model(self.vehicle, {**terms_of(nuisances_of(self.adapt)), **cast("Terms", self.terms)})
        lower, upper = bounds(model)
        fixed = held(model) + (tuple(n for n in model.names if n.startswith("inertia.")) if _held_rate(model) else ())
        fixed += tuple(n for n in model.names if n.partition(".")[0] in self.hold)
        free = np.array([name not in fixed for name in model.names])
        lower, upper = np.where(free, lower, model.values), np.where(free, upper, model.values)
        given = {p.names for p in self.soft}
        soft = (*self.soft, *(p for p in priors(model) if p.names not in given))
        soft = tuple(p for p in soft if any(name not in fixed for name in p.names))
        problem = Problem(model, data, free, lower, upper, soft, nuisances, _share(cuts), self.threads,
                          progress=self.progress)
        known: tuple[Solution, list[str]] | None = None if like is None else like.searched_
        if known is None or known[0].problem.model != model:
            known = without_effect(solve(problem))
        self.searched_: tuple[Solution, list[str]] = known
        solution, unseen = known
        problem = solution.problem
        self.solution_, self.data_ = solution, data
        labels = [self.sessions.get(name, UNKNOWN) for name in data.names]
        ci95 = bootstrap(solution, self.seed, labels) if self.judged else None
        flown = np.unique(data.flight)
        why = why_not(len(flown), np.array(labels)[flown]) if self.judged else "not asked for"
        stand_in = "held: so heavy that this model does not turn" if _held_rate(model) else "held"
        why_held = {name: stand_in if name.startswith("inertia.") else "held" for name in model.names}
        parameters = {name: _parameter(float(v), unit, (ci95 or {}).get(name), why if problem.free[k] else
                                       why_held[name], (problem.lower[k], problem.upper[k]))
                      for k, (name, v, unit) in enumerate(zip(model.names, solution.model.values, model.units,
                                                              strict=True))}
        self.model_ = tidy(solution.model)
        self.parameters_ = {name: entry for name, entry in parameters.items() if name in self.model_.names}
        self.predictor_ = self._predictor(solution, cuts)
        flies_on = None if _held_rate(model) or not self.judged else flies(self.model_, data)
        self.result_ = FitResult(self.name, self.adapt, self.parameters_, len(data), len(flown), solution.steps,
                                 solution.cost, self._trouble(solution, flies_on), flies_on,
                                 (*(f"{name} ends at {solution.model.parameters[name]:g}, where it has no effect, and "
                                    "is held there: these flights do not show it" for name in unseen),
                                  *(not_identified(solution, ci95) if self.judged else ()), *self._not_learnt()),
                                 tuple(f"{' + '.join(p.names)} = {p.mean:.3g} +- {p.sd:.2g} ({p.source})"
                                       for p in problem.priors),
                                 tuple(f"{n.name}: {n.sentence}" for n in nuisances))
        return self

    def _predictor(self, solution: Solution, cuts: Sequence[Cut]) -> GreyBoxPredictor:
        if self.adapt == "none":
            return GreyBoxPredictor(self.name, self.model_.as_dict(), self.vehicle, parameters=self.parameters_)
        nuisances = nuisances_of(self.adapt)
        problem = replace(solution.problem, nuisances=(), model=solution.model, data=self.data_)
        shared = solution.model.values
        scale = usual_errors(problem, shared, np.zeros((len(problem.data.names), 0)))
        made = GreyBoxPredictor(self.name, solution.model.as_dict(), self.vehicle, self.adapt, scale=scale,
                                parameters=self.parameters_, nuisances_=nuisances)
        features = joined([made.features(c.windows) for c in cuts])
        gains, self.ridge_ = learn_gains(problem, shared, features, nuisances)
        return replace(made, gains=gains)

    def _not_learnt(self) -> list[str]:
        if self.adapt == "none" or np.isfinite(self.ridge_):
            return []
        return ["what differs between flights: too few flights to leave one out, every window gets the mean"]

    def _trouble(self, solution: Solution, flown: Flown | None) -> str:
        data = self.data_
        volts = data.motor * data.battery_V[..., None] if "thrust_voltage" in solution.model else data.motor
        falling = falling_thrust(solution.model, *np.quantile(volts, [0.02, 0.98]))
        bound = f"on its bound: {', '.join(solution.on_bound)}" if solution.on_bound else ""
        grounded = "" if flown is None or flown.flies else f"does not fly: {flown}"
        return "; ".join(filter(None, (solution.trouble, bound, falling, grounded)))

    def predict(self, windows: Windows) -> Prediction:
        """States 1..H steps after the start of every window."""
        self._check()
        return self.predictor_.predict(windows)

    def score(self, flights: Sequence[Flight | Case]) -> dict[str, dict[str, float]]:
        """Task 1 errors {metric: {"1", "10", "50", "sum"}} over all windows of ``flights``, onboard truth."""
        return mean_errors(self.predict, cut(_cases(flights), past=self.adapt == "past", thin=1))

    def profile(self, name: str, values: Sequence[float]) -> list[dict[str, float]]:
        """Profile likelihood of one parameter, see ``intervals.profile``."""
        self._check()
        return profile(self.solution_, name, values)

    def _check(self) -> None:
        if not hasattr(self, "predictor_"):
            raise UsageError("this model is not fitted yet; call fit(flights) first")


def without_effect(solution: Solution) -> tuple[Solution, list[str]]:
    """A fit without the parameters that ended on a bound at which they do nothing, and their names. On any other bound
    it stays, and is no result."""
    unseen: list[str] = []
    while solution.on_bound:
        model, problem = solution.model, solution.problem
        neutral = {slot.name: slot.parameter.neutral for slot in model.slots}
        idle = [name for name in solution.on_bound if model.parameters[name] == neutral[name]]
        if not idle:
            break
        unseen += idle
        solution = solve(replace(problem, model=model, free=problem.free & ~np.isin(model.names, idle)))
    return solution, unseen


def nuisances_of(adapt: str) -> tuple[Nuisance, ...]:
    """What a model with ``adapt`` sets per window."""
    return () if adapt == "none" else (SCALE, *TRIMS, *TILT, *STARTS)


def tidy(model: Model) -> Model:
    """Lists of a fixed mean with that mean, but for values on a bound, and terms left out that only the nuisances went
    through."""
    terms = model.as_dict()
    for term in model.terms:
        for parameter in (p for p in term.parameters if p.fixed_mean is not None and p.name in terms[term.name]):
            values = np.array(terms[term.name][parameter.name])
            terms[term.name][parameter.name] = tuple(np.clip(values / values.mean() * parameter.fixed_mean,
                                                             parameter.lower, parameter.upper))
    passed = terms_of((SCALE, *TILT), model.vehicle)
    return Model(model.vehicle, {name: values for name, values in terms.items() if passed.get(name) != values})


def _held_rate(model: Model) -> bool:
    return bool(model.values_of("inertia").get("inertia_kg_m2", (0.0,))[0] == HEAVY)


def _share(cuts: Sequence[Cut]) -> float:
    """How many independent observations a window is."""
    return min(1.0, EVERY_S * max(c.thin for c in cuts) / INDEPENDENT_S)


def _cases(flights: Sequence[Flight | Case]) -> list[Case]:
    return [*(f for f in flights if isinstance(f, Case)), *cases_of([f for f in flights if isinstance(f, Flight)])]


__all__ = ["FitWindows", "GreyBox", "nuisances_of", "tidy"]


def _parameter(value: float, unit: str, ci95: tuple[float, float] | None, why: str,
               allowed: tuple[float, float]) -> Estimate:
    if ci95 is None and not why:
        why = f"fewer than {FEWEST_FLIGHTS} flights"
    if ci95 is not None and any(np.isclose(ci95, allowed, atol=0.0)):
        why = f"{why}; ".removeprefix("; ") + "ends at a bound"
    return Estimate(value, ci95, unit, why)
