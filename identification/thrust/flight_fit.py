"""Fits of thrust maps to the specific force that flights show, alone or with what else acts in the air.

    a_z = sum_i T(u_i, V) / m - g (k_z v_z - k_h v_xy^2 + heat h - trim . q)

Every model sees the inputs delayed by one number, found on the training flights. The shape of a map (how voltage and
PWM trade) is found with a free per-flight offset, of 0.15 m/s^2 SD. Vehicles, batteries and so masses differ between
flights, and a difference of mean between two flights contains no information on the voltage law. The coefficients then
follow from all rows of all training flights; a test flight gets no per-flight values.

Balanced models know one thing more of a flight: that it flies. Over the last seconds in the air the thrust equalled
the weight on average. The thrust that the map gives to these inputs therefore shows its error for this vehicle,
battery and air. Only inputs of the past are used, no accelerometer (``balanced.py``).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from nanobench_tools.errors import UsageError
from nanobench_tools.flight import Flight, Span
from nanobench_tools.physics.vehicle import BOUNDS
from nanobench_tools.results import array_fields
from nanobench_tools.settings import count, number
from nanobench_tools.units import GRAVITY_M_S2

from .balanced import balance, fit_balanced
from .flight_rows import EVERY, RATE_HZ, Flown, fly
from .maps import MAPS, Map, Numbers
from .stand_fit import WORST_CONDITION, Fit, no_motor, prior_cost, search, solve

LEVEL_SD = number("thrust.flight_fit.level_sd")
NOISE_SD = number("thrust.flight_fit.noise_sd")
CORRELATION_S = number("thrust.flight_fit.correlation_s")
"""Spread [m/s^2] of the mean error between flights, and within them, and over how long errors within one hold."""

SHAPE_ROWS = count("thrust.flight_fit.shape_rows")

DELAYS_S = tuple(np.round(np.arange(0.0, 0.1201, 0.01), 3))

EFFECTS = (("k_z", "s/m"), ("k_h", "s^2/m^2"), ("heat", "1/V^2"), ("trim_roll", "1"), ("trim_pitch", "1"),
           ("trim_yaw", "1"))
"""Inflow (climbing, flying sideways), warm motors, unequal motors: effects in the air that the map omits."""

IN_FLIGHT = ("thrust_pwm", "thrust_voltage", "switched_motor")
"""Maps that are also fitted together with the effects."""

SUFFIX = "_in_flight"

BALANCED = "_balanced"

BALANCING = ("scaled_2_1_plus", "scaled_legacy", "thrust_pwm", "thrust_voltage", "dc_motor", "switched_motor")
"""Maps that are also scaled to the weight a flight carried, the firmware's cubics among them."""

GIVEN = {"": "inputs and battery now", SUFFIX: "inputs and battery, velocity; inputs of the last 20 s",
         BALANCED: "inputs and battery; those of the last seconds in the air"}
"""What a prediction is made from, by kind of model."""


@dataclass(frozen=True)
class FlightModel:
    """A map, alone, with the effects, or balanced on the weight, for a vehicle of ``mass_kg``."""

    map: Map
    effects: bool
    mass_kg: float
    balanced: bool = False

    @property
    def kind(self) -> str:
        return SUFFIX if self.effects else BALANCED if self.balanced else ""

    @property
    def name(self) -> str:
        return self.map.name + self.kind

    @property
    def given(self) -> str:
        """What a prediction is made from."""
        return GIVEN[self.kind]

    @property
    def size(self) -> int:
        return self.map.size + len(EFFECTS) * self.effects

    @property
    def uses(self) -> str:
        """What the model uses, for its row."""
        acts = "; inflow, warm motors (inputs of the last 5 s), unequal motors (of the last 20 s)"
        carries = "; scaled to the weight it carried on the inputs of the last 5 s in the air"
        return self.map.equation + (acts if self.effects else carries if self.balanced else "")

    def design(self, shape: Numbers, flown: Flown) -> np.ndarray:
        """(k, n) columns of specific force m/s^2."""
        columns = self.map.design(shape, flown.u, flown.battery_V[:, None]).sum(axis=2) / self.mass_kg
        return np.concatenate([columns, effect_columns(flown)]) if self.effects else columns

    @property
    def names(self) -> list[str]:
        return [name for name, _ in (*self.map.linear, *(EFFECTS if self.effects else ()))]

    @property
    def units(self) -> dict[str, str]:
        return self.map.units | (dict(EFFECTS) if self.effects else {})


@dataclass(frozen=True)
class FlightFit:
    """values by name; ``fit``: the map alone, per motor; trouble as in ``Fit``."""

    model: FlightModel
    values: Mapping[str, float]
    shape: tuple[float, ...]
    trouble: str = ""

    @property
    def fit(self) -> Fit:
        return Fit(self.model.map, self.values, self.trouble, self.shape)

    def predict(self, flown: Flown) -> np.ndarray:
        """Specific force along body z (n,) m/s^2."""
        found: np.ndarray = np.array([self.values[n] for n in self.model.names]) @ self.model.design(self.shape, flown)
        if not self.model.balanced:
            return found
        return np.asarray(found * balance(self.carried(flown.lift[:, :4], flown.lift[:, 4]), flown.lift[:, 5]))

    def carried(self, u: np.ndarray, battery_V: np.ndarray) -> np.ndarray:
        """Specific force (n,) m/s^2 of four motors at PWM ratios (n, 4) and voltages (n,), by the map alone."""
        return np.asarray(self.fit.predict(u, battery_V[:, None]).sum(axis=1) / self.model.mass_kg)


def effect_columns(flown: Flown) -> np.ndarray:
    """(6, n) of EFFECTS, m/s^2 per unit of each."""
    return GRAVITY_M_S2 * np.stack([-flown.climb, flown.across2, -flown.heat, *flown.trim.T])


def models(mass_kg: float) -> dict[str, FlightModel]:
    """All candidates by name. UsageError for a mass that cannot be."""
    low, high = BOUNDS["mass_kg"]
    if not low <= mass_kg <= high:
        raise UsageError(f"mass {mass_kg:g} kg is outside {low:g} to {high:g} kg; is it in grams?")
    found = [FlightModel(m, False, mass_kg) for m in MAPS.values()]
    found += [FlightModel(MAPS[name], True, mass_kg) for name in IN_FLIGHT]
    found += [FlightModel(MAPS[name], False, mass_kg, balanced=True) for name in BALANCING]
    return {m.name: m for m in found}


def fit_flights(model: FlightModel, flights: Sequence[Flown], weights: Numbers | None = None,
                start: Sequence[float] | None = None) -> FlightFit:
    """The model fitted to all rows of ``flights``; ``weights``: how often each counts (a bootstrap)."""
    candidate = model.map
    if candidate.fixed is not None:
        values = {name: c for (name, _), c in zip(candidate.linear, candidate.fixed, strict=True)}
        return FlightFit(model, values, ())
    counts = np.ones(len(flights)) if weights is None else np.asarray(weights, float)
    flights, counts = [f for f, c in zip(flights, counts, strict=True) if c > 0.0], counts[counts > 0.0]
    if model.effects and not all(f.moving for f in flights):
        return FlightFit(model, {}, (), "no velocity in " + ", ".join(f.name for f in flights if not f.moving))
    shape, trouble = _shape(model, flights, counts, start) if candidate.shape else (np.empty(0), "")
    columns = np.concatenate([model.design(shape, f) for f in flights], axis=1)
    target = np.concatenate([f.force for f in flights])
    row_weights = np.concatenate([np.full(len(f), c) for f, c in zip(flights, counts, strict=True)])
    found, _, condition = solve(columns, target, row_weights)
    if model.balanced:
        weight = EVERY / RATE_HZ / CORRELATION_S / NOISE_SD**2
        shape, found, trouble = fit_balanced(candidate, model.mass_kg, flights, counts, shape, found, weight)
    values = dict(zip(model.names, map(float, found), strict=True))
    values |= {s.name: float(x) for s, x in zip(candidate.shape, shape, strict=True)}
    if not trouble and condition > WORST_CONDITION:
        trouble = f"not identified by these flights (condition {condition:.1e})"
    u = np.concatenate([f.u.ravel() for f in flights])
    volts = np.concatenate([f.battery_V for f in flights])
    trouble = trouble or no_motor(Fit(candidate, values), u, (volts.min(), volts.max()))
    return FlightFit(model, values, tuple(map(float, shape)), trouble)


def _shape(model: FlightModel, flights: Sequence[Flown], counts: np.ndarray,
           start: Sequence[float] | None) -> tuple[np.ndarray, str]:
    """Shape values by generalised least squares with a free level per flight, and what is wrong with them."""
    thin = -(-sum(map(len, flights)) // SHAPE_ROWS)
    few = [f.rows(slice(None, None, thin)) for f in flights]
    joined, starts = array_fields.joined(few), np.cumsum([0, *map(len, few[:-1])])
    sizes = np.array([len(f) for f in few])
    effective = np.maximum(np.array([len(f) for f in flights]) * EVERY / RATE_HZ / CORRELATION_S, 1.0)
    weights = np.repeat(counts * effective / sizes, sizes)

    def cost(shape: np.ndarray) -> float:
        both = np.concatenate([model.design(shape, joined), joined.force[None]])
        both = both - level_free(both, starts, sizes, effective)
        return solve(both[:-1], both[-1], weights)[1] / NOISE_SD**2 + prior_cost(model.map, shape)

    return search(model.map, cost, start)


def level_free(columns: np.ndarray, starts: np.ndarray, sizes: np.ndarray, effective: np.ndarray) -> np.ndarray:
    """What to take from columns (k, n) of flights laid end to end: most of each flight's mean. Least squares on the
    rest is the generalised least squares of a random level per flight (Balestra and Nerlove 1966)."""
    share = 1.0 - NOISE_SD / np.sqrt(NOISE_SD**2 + effective * LEVEL_SD**2)
    return np.repeat(np.add.reduceat(columns, starts, axis=1) / sizes * share, sizes, axis=1)


def find_delay(cases: Sequence[tuple[Flight, Sequence[Span]]], mass_kg: float) -> float:
    """By how much [s] the specific force follows the motor inputs: smallest error within flights of ``thrust_voltage``
    with the effects over DELAYS_S. Motor, filters of the sensor and of the log together."""
    best = (np.inf, 0.0)
    for delay in DELAYS_S:
        flights = [fly(flight, spans, delay) for flight, spans in cases]
        model = FlightModel(MAPS["thrust_voltage"], all(f.moving for f in flights), mass_kg)
        sizes = np.array([len(f) for f in flights])
        both = np.concatenate([np.concatenate([model.design((), f), f.force[None]]) for f in flights], axis=1)
        both = both - level_free(both, np.cumsum([0, *sizes[:-1]]), sizes, sizes * EVERY / RATE_HZ / CORRELATION_S)
        best = min(best, (solve(both[:-1], both[-1], np.ones(both.shape[1]))[1] / sizes.sum(), float(delay)))
    return best[1]
