"""One physical vehicle from any flights: sums over whole flights where they identify a parameter, priors elsewhere.

Every parameter has a prior with a source. Where flights identify it, both are weighed by their variances. That of the
flights comes from drawing sessions and flights within them, and from the systematic error of the method. What rows of
10 ms in closed loop cannot show (lag, yaw moment, shape of the thrust curve, damping) keeps its prior and is marked.
Measured rotor speed shows lag and inertia, where flights have it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from nanobench_tools.errors import InputError
from nanobench_tools.metrics.statistics import UNKNOWN, refit_weights, why_not
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.physics.term import Belief
from nanobench_tools.protocols.sessions import sessions_of
from nanobench_tools.protocols.task1 import Case
from nanobench_tools.results.fitted_values import Estimate
from nanobench_tools.settings import number

from .measured_motors import Measured, measured_motors
from .motion_sums import BAND_HZ, EDGE_SHARE, LEAST_S, SHORTEST_S, MotionSums, motion_sums
from .vehicle_priors import Priors, PriorsFile, priors_of

LEVEL_SD = number("vehicle.vehicle_fit.level_sd")
DRAG_SD = number("vehicle.vehicle_fit.drag_sd")
AIR_MOMENT_SD = number("vehicle.vehicle_fit.air_moment_sd")
INERTIA_SD = number("vehicle.vehicle_fit.inertia_sd")
"""Systematic errors, as shares of the value."""
TRIM_SD = number("vehicle.vehicle_fit.trim_sd")
THRUST_SPREAD = number("vehicle.vehicle_fit.thrust_spread")
SPREAD_FLIGHTS = number("vehicle.vehicle_fit.spread_flights")
DRAWS = 400
"""Of sessions, flights and priors."""
MOSTLY = 0.5
"""Share of the prior from which on a parameter is called a prior."""
APART = 3.0
"""Standard deviations between flights and prior from which on the result says so."""
NORMAL_95 = 1.96
"""Half-width of a 95 % interval of the normal distribution in standard deviations."""
FEWEST_FLIGHTS = 3
"""Fewer flights give no interval between flights."""
INDEPENDENT_S = 1.0
"""Disturbances last about so long."""
OTHER_MOTORS = number("vehicle.vehicle_fit.other_motors")
ONE_VEHICLE = number("vehicle.vehicle_fit.one_vehicle")
STILL = 0.8
"""Share of the prior in drag from which on the flights show none."""
OTHERS = ("the thrust is not that of the motors behind the priors. {} of these motors {} not known and {} a wide "
          "prior. Give your own with a priors file")
"""What of the motors is a prior."""
LAGS = ("motor_lag.tau_up_s", "motor_lag.tau_down_s")
TERMS = ("thrust_voltage", "thrust_scale", "motor_imbalance", "command_delay", "motor_lag", "inertia", "yaw_torque",
         "angular_damping", "drag_linear", "drag_torque")


@dataclass(frozen=True)
class VehicleFit:
    """A fitted physical vehicle.

    - model; parameters by name, with interval and share of the prior.
    - draws (D, P): of the model's flat vector.
    - priors, notes: sentences, which priors there are and where the flights disagree.
    - thrust_spread: standard deviation of the thrust of single flights about ``thrust_scale.s``, as a share of it.
    - flights and seconds that took part."""

    model: Model
    parameters: Mapping[str, Estimate]
    draws: np.ndarray
    priors: tuple[str, ...]
    notes: tuple[str, ...]
    thrust_spread: float
    flights: int
    seconds: float


@dataclass(frozen=True)
class _Weighed:
    """values (1 + D,): the estimate, then draws; share of the prior (1: it is the prior); note."""

    values: np.ndarray
    share: float
    belief: Belief
    note: str = ""


def fit_vehicle(cases: Sequence[Case], vehicle: Vehicle | None = None, seed: int = 0,
                sessions: Mapping[str, int] | None = None, priors: PriorsFile | None = None) -> VehicleFit:
    """The vehicle of ``cases``; sessions {flight: label} are drawn for intervals; priors: the user's.

    Raises InputError where no flight is long enough for a sum, or the priors' file cannot be used.
    """
    vehicle = vehicle or Vehicle()
    known = priors_of(vehicle, priors)
    measured = measured_motors(cases, vehicle, seed)
    found = _sums(cases, vehicle, known, measured)
    _one_vehicle(found, cases)
    others = ""
    if known.note:
        hover_V = float(np.mean([flight.volts for flight in found]))
        known = known.scaled_to(hover_V, vehicle.mass_kg * vehicle.gravity_m_s2 / vehicle.rotors)
        found = _sums(cases, vehicle, known, measured)
    elif known.others and _other_motors(found, known.believed["thrust_scale.s"]):
        known = known.of_other_motors()
        found = _sums(cases, vehicle, known, measured)
        held = ("yaw moment", "is", "has") if measured else ("lag and yaw moment", "are", "have")
        others = OTHERS.format(*held)
    labels = np.array([(sessions or sessions_of([case.flight for case in cases])).get(f.name, UNKNOWN) for f in found])
    counts = np.vstack([np.ones(len(found)), refit_weights(len(found), labels, seed, DRAWS)])
    weighed = _weighed(found, counts, known, measured, vehicle, np.random.default_rng(seed))
    model, draws = _models(weighed, vehicle)
    why = f"fewer than {FEWEST_FLIGHTS} flights" if len(found) < FEWEST_FLIGHTS else why_not(len(found), labels)
    parameters = {name: _estimate(weighed[name], value, unit, column, why, len(found))
                  for name, value, unit, column in zip(model.names, model.values.tolist(), model.units, draws.T,
                                                       strict=True)}
    notes = [known.note, others, _still(weighed),
             *(f"{name}: {weighed[name].note}" for name in model.names if weighed[name].note)]
    levels = np.array([flight.level for flight in found])
    spread = thrust_spread(levels)
    own = f"{100.0 * np.std(levels, ddof=1) / np.mean(levels):.1f} % in these" if len(levels) > 1 else "one flight"
    said = (f"thrust of a single flight = thrust_scale.s +- {100.0 * spread:.1f} % ({own}; prior "
            f"{100.0 * THRUST_SPREAD:g} % of {SPREAD_FLIGHTS:.0f} flights of another vehicle)")
    return VehicleFit(model, parameters, draws, (*_sentences(known), said), tuple(filter(None, notes)), spread,
                      len(found), sum(flight.seconds for flight in found))


def thrust_spread(levels: np.ndarray) -> float:
    """Standard deviation of the thrust of single flights over its mean.

    A prior counts as SPREAD_FLIGHTS further flights. levels (F,): force over thrust of each flight."""
    n = len(levels) - 1
    own = float(np.sum((levels / np.mean(levels) - 1.0) ** 2))
    prior = SPREAD_FLIGHTS - 1.0
    return float(np.sqrt((own + prior * THRUST_SPREAD**2) / (n + prior)))


def _sentences(known: Priors) -> tuple[str, ...]:
    """One a parameter, its elements together."""
    groups: dict[str, list[Belief]] = {}
    for name, belief in known.believed.items():
        groups.setdefault(name.partition("[")[0], []).append(belief)
    return (f"thrust_voltage.c: {known.curve_source}", *(
        f"{name} = {', '.join(f'{b.mean:.3g}' for b in beliefs)} +- {', '.join(f'{b.sd:.2g}' for b in beliefs)} "
        f"({beliefs[0].source})" for name, beliefs in groups.items()))


def _one_vehicle(found: Sequence[MotionSums], cases: Sequence[Case]) -> None:
    """InputError where the thrust of flights differs by more than batteries and days explain."""
    weak, strong = min(found, key=lambda flight: flight.level), max(found, key=lambda flight: flight.level)
    ratio = strong.level / weak.level
    if weak.level <= 0.0 or ratio > ONE_VEHICLE:
        place = next(case.flight.provenance.path for case in cases if case.flight.name == strong.name)
        raise InputError(place, f"another vehicle or mass than {weak.name}: {ratio:.2f} times the thrust per mass at "
                                "the same command", "give the flights of one vehicle at a time")


def _still(weighed: Mapping[str, _Weighed]) -> str:
    """A note where the flights hardly moved sideways; empty elsewhere."""
    names = ("drag_linear.d[0]", "drag_linear.d[1]", "drag_torque.c")
    if any(weighed[name].share < STILL for name in names):
        return ""
    return ("these flights hardly move sideways: drag and the moment of the air are priors; fly a path at 0.5 m/s or "
            "faster")


def _other_motors(found: Sequence[MotionSums], level: Belief) -> bool:
    """Whether the flights' thrust is far from that of the motors behind the priors."""
    off = float(np.mean([flight.level for flight in found])) - level.mean
    return abs(off) > OTHER_MOTORS * level.sd


def _lags(known: Priors, measured: Mapping[str, Measured]) -> tuple[float, float]:
    """Mean of the lags up and down, and its standard deviation [s], of priors and measured rotor speed."""
    means, sds = [], []
    for name in LAGS:
        belief, seen = known.believed[name], measured.get(name)
        share = 1.0 if seen is None else seen.sd**2 / (seen.sd**2 + belief.sd**2)
        means.append(share * belief.mean + (0.0 if seen is None else (1.0 - share) * seen.value))
        sds.append(np.sqrt(share) * belief.sd)
    return float(np.mean(means)), float(np.mean(sds))


def _sums(cases: Sequence[Case], vehicle: Vehicle, known: Priors,
          measured: Mapping[str, Measured]) -> list[MotionSums]:
    lag_s = _lags(known, measured)[0]
    for shortest_s in (SHORTEST_S, LEAST_S):
        if found := [sums for case in cases
                     for sums in [motion_sums(case, vehicle, known.curve, lag_s, shortest_s)] if sums is not None]:
            return found
    place = cases[0].flight.provenance.path if cases else "data"
    raise InputError(place, f"no flight with {LEAST_S / (1.0 - 2.0 * EDGE_SHARE):.1f} s of clean flight",
                     "give longer flights; nanobench audit shows what is clean")


def _weighed(found: Sequence[MotionSums], counts: np.ndarray, known: Priors, measured: Mapping[str, Measured],
             vehicle: Vehicle, rng: np.random.Generator) -> dict[str, _Weighed]:
    """Every parameter of the model. counts (1 + D, F): how often each flight counts; the first row is the estimate."""

    def weigh(name: str, values: np.ndarray, share: float, noise: float = 0.0) -> _Weighed:
        return _weigh(values, known.believed[name], share, noise, rng)

    def hold(name: str) -> _Weighed:
        return _hold(known.believed[name], len(counts), rng)

    held = {name: hold(name) for name in known.believed
            if name.startswith(("motor_lag.", "command_delay.", "yaw_torque.", "angular_damping.", "drag_linear.d[2]",
                                "inertia.inertia_kg_m2[2]"))}
    seen = {name: weigh(name, np.full(len(counts), value.value), 0.0, value.sd) for name, value in measured.items()}
    held |= {name: value for name, value in seen.items() if name in held}
    # draws keep one shape of the curve: coefficients trade against each other, and the level belongs to the shape
    curve = {f"thrust_voltage.c[{k}]": _Weighed(np.full(len(counts), c), 1.0, Belief(c, sd, known.curve_source))
             for k, (c, sd) in enumerate(zip(known.curve, known.curve_sd, strict=True))}
    total = counts.sum(axis=1)
    level = weigh("thrust_scale.s", counts @ np.array([flight.level for flight in found]) / total, LEVEL_SD)
    s = level.values

    drag, air, turning = (np.einsum("df,fij->dij", counts, [getattr(flight, name) for flight in found])
                          for name in ("drag", "air", "turning"))
    d = {f"drag_linear.d[{i}]": weigh(f"drag_linear.d[{i}]", drag[:, i, 1] / drag[:, i, 0], DRAG_SD,
                                      _noise(*drag[0, i])) for i in (0, 1)}
    damping = np.stack([held[f"angular_damping.d_r[{i}]"].values for i in (0, 1)], axis=1)
    names = [f"inertia.inertia_kg_m2[{i}]" for i in (0, 1)]
    inertia = np.array([known.believed[name].mean for name in names])

    def moment_of_air(inertia: np.ndarray) -> np.ndarray:
        left = s[:, None] * air[:, :, 1] - inertia * air[:, :, 2] - damping * air[:, :, 3]
        return np.asarray(left.sum(axis=1) / air[:, :, 0].sum(axis=1))

    c = moment_of_air(inertia)
    j = (s[:, None] * turning[:, :, 1] - damping * turning[:, :, 2] - c[:, None] * turning[:, :, 3]) / turning[:, :, 0]
    inertia_sd = float(np.hypot(INERTIA_SD, _lag_share(known, measured)))
    turned = {name: weigh(name, j[:, i], inertia_sd, s[0] * _noise(*turning[0, i, [0, 1, 4]]))
              for i, name in enumerate(names)} | {name: seen[name] for name in names if name in seen}
    c = moment_of_air(np.stack([turned[name].values for name in names], axis=1))
    moment = weigh("drag_torque.c", c, AIR_MOMENT_SD, s[0] * _noise(*air[0][:, [0, 1, 4]].sum(axis=0)))
    gains = counts @ np.array([_trim(flight, float(s[0]), float(moment.values[0]), vehicle) for flight in found])
    g = {f"motor_imbalance.g[{i}]": weigh(f"motor_imbalance.g[{i}]", gains[:, i] / total, TRIM_SD)
         for i in range(vehicle.rotors)}
    return {**curve, "thrust_scale.s": level, **g, **d, **turned, "drag_torque.c": moment, **held}


def _lag_share(known: Priors, measured: Mapping[str, Measured]) -> float:
    """Standard deviation of an inertia, as a share, that follows from that of the motors' lag.

    Slope at t = tau of the scale (1 + w^2 tau t) / (1 + w^2 tau^2). A lag tau for a true lag t scales the moment in
    phase with the angular acceleration by this, at the angular frequency w.
    """
    lag_s, sd_s = _lags(known, measured)
    turns = (2.0 * np.pi * float(np.mean(BAND_HZ)) * lag_s) ** 2
    return sd_s / lag_s * turns / (1.0 + turns)


def _trim(flight: MotionSums, s: float, c: float, vehicle: Vehicle) -> np.ndarray:
    """(4,) gains with mean 1 that balance the moments of the flight's mean thrusts, its drift through the air kept."""
    x, y = np.array(vehicle.motor_positions_m).T
    thrust = s * flight.thrust_N
    matrix = np.stack([np.full(len(x), 1.0 / len(x)), y * thrust, -x * thrust, np.array(vehicle.spin) * thrust])
    drift = c * np.array([flight.velocity_m_s[1], -flight.velocity_m_s[0]])
    return np.asarray(np.linalg.lstsq(matrix, np.array([1.0, *drift, 0.0]), rcond=None)[0])


def _noise(xx: float, xy: float, yy: float) -> float:
    """Standard deviation of the slope xy / xx, from integrals over time: one observation a second is independent."""
    return float(np.sqrt(max(yy - xy**2 / xx, 0.0) * INDEPENDENT_S) / xx)


def _weigh(values: np.ndarray, belief: Belief, share: float, noise: float, rng: np.random.Generator) -> _Weighed:
    """values (1 + D,) of the flights and a prior; ``share``: systematic error over the prior's mean; noise: standard
    deviation that drawing flights does not show."""
    size = float(np.hypot(share * belief.mean, noise))
    sd = float(np.hypot(np.std(values[1:]), size))
    prior = sd**2 / (sd**2 + belief.sd**2)
    drawn = rng.standard_normal((2, len(values)))
    drawn[:, 0] = 0.0
    found = (1.0 - prior) * (values + size * drawn[0]) + prior * (belief.mean + belief.sd * drawn[1])
    off = (values[0] - belief.mean) / np.hypot(sd, belief.sd)
    note = "" if abs(off) < APART else (f"the flights by themselves give {values[0]:.3g}, {abs(off):.1f} standard "
                                        f"deviations from the prior {belief.mean:.3g} +- {belief.sd:.2g}")
    return _Weighed(found, float(prior), belief, note)


def _hold(belief: Belief, size: int, rng: np.random.Generator) -> _Weighed:
    found = belief.mean + belief.sd * rng.standard_normal(size)
    found[0] = belief.mean
    return _Weighed(found, 1.0, belief)


def _estimate(found: _Weighed, value: float, unit: str, draws: np.ndarray, why: str, flights: int) -> Estimate:
    belief, share = found.belief, found.share
    low, high = np.quantile(draws, [0.025, 0.975]).tolist()
    if share == 1.0:
        if low == high:  # the shape of the curve, which draws keep
            low, high = belief.mean - NORMAL_95 * belief.sd, belief.mean + NORMAL_95 * belief.sd
        return Estimate(value, (float(low), float(high)), unit, f"prior: {belief.source}", share)
    if share > MOSTLY:
        why = "; ".join(filter(None, [f"mostly prior: {belief.source}", why]))
    return Estimate(value, (low, high) if flights >= FEWEST_FLIGHTS else None, unit, why, share)


def _models(weighed: Mapping[str, _Weighed], vehicle: Vehicle) -> tuple[Model, np.ndarray]:
    """The model, and draws (D, P) of its flat vector, inside physical bounds."""
    terms: dict[str, Any] = {term: {} for term in TERMS}
    for name, entry in weighed.items():
        term, _, rest = name.partition(".")
        key, _, element = rest.partition("[")
        value = float(entry.values[0])
        terms[term][key] = (*terms[term].get(key, ()), value) if element else value
    base = Model(vehicle, {**terms, "motor_imbalance": {"g": (1.0,) * vehicle.rotors}})
    values = np.clip(np.array([weighed[name].values for name in base.names]).T, base.lower, base.upper)
    gains = [base.index(f"motor_imbalance.g[{i}]") for i in range(vehicle.rotors)]
    values[:, gains] /= values[:, gains].mean(axis=1, keepdims=True)
    return base.with_values(values[0]), values[1:]
