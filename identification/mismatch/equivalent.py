"""A simulator that is only a callable, as a model: its output along the flights, and terms that give the same.

The residual is that of the callable. Hypotheses about it need parameters, and predictions over half a second need a
model that flies. So a model of terms is fitted to the callable's output along the measured states and inputs, without
noise. The part that it does not reproduce stays part of the simulator. If that part is large, no effect is identified.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from nanobench_tools import so3
from nanobench_tools.errors import InputError
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.physics.adapters.given import UP, Along, Simulator, run
from nanobench_tools.physics.vocabulary import terms_that
from nanobench_tools.settings import count, number, setting

from .believe import start_of
from .naming import free_of
from .recordings import Recordings
from .space import Space, fixed_mean, reduced, scales, space_around
from .track import BEFORE_S, NO_BATTERY_V, ROW_S, Track
from .wrench import CHANNELS, TORQUE_ROWS, Wrench

NEVER = terms_that(lambda term: term.level or term.is_limit or term.is_map)
"""Terms that are not fitted: only seen in products with the thrust map, or without a slope where they rest."""
TOLERANCE = setting("mismatch.equivalent.tolerance")
LEAST_GAIN = number("mismatch.equivalent.least_gain")
IDLE = number("mismatch.equivalent.idle")
MOST = count("mismatch.equivalent.most")
BLOCK_S = number("mismatch.equivalent.block_s")
MOST_S = number("mismatch.equivalent.most_s")
LAG_S = number("mismatch.equivalent.lag_s")
RIDGE = number("mismatch.equivalent.ridge")
ALIKE = setting("mismatch.equivalent.alike")
LIFTS = number("mismatch.equivalent.lifts")
TURNS = setting("mismatch.equivalent.turns")
AGAINST = number("mismatch.equivalent.against")
PROBED_V = 0.4
PROBED_SHARE, PROBED_ROWS = 0.02, 200
"""A probed motor gives less by this share, for rows of 10 ms that are longer than rotors lag."""


@dataclass(frozen=True)
class Equivalent:
    """``model`` represents the simulator ``name``; ``gap``: output of the simulator minus that of the model, as
    ``Wrench.measured``; ``shares`` (force, torque): RMS of the gap over the standard deviation of the simulator's
    output; ``rms`` of the gap m/s^2, rad/s^2; ``by_channel`` (6,) as shares; ``needs_battery``: whether the simulator
    uses the battery."""

    name: str
    model: Model
    gap: tuple[np.ndarray, np.ndarray]
    shares: tuple[float, float]
    rms: tuple[float, float]
    by_channel: np.ndarray
    needs_battery: bool
    notes: tuple[str, ...] = ()

    @property
    def alike(self) -> bool:
        return bool(self.shares[0] <= ALIKE[0] and self.shares[1] <= ALIKE[1])

    @property
    def sentence(self) -> str:
        """Description of the procedure for the reader."""
        how = f"reproduce its force to {self.rms[0]:.3f} m/s^2 ({self.shares[0]:.1%} of how it moves)"
        if len(self.gap[1]):
            how += f" and its angular acceleration to {self.rms[1]:.2f} rad/s^2 ({self.shares[1]:.1%})"
        terms = ", ".join(t.name for t in self.model.terms)
        notes = "".join(f" {note}." for note in self.notes)
        if not self.alike:
            return (f"{self.name} was evaluated along the measured states and inputs. Terms fitted to its output "
                    f"({terms}) only {how}, worst in {CHANNELS[int(np.argmax(self.by_channel))]}; without parameters "
                    f"that can be changed no effect can be identified.{notes}")
        return (f"{self.name} was evaluated along the measured states and inputs, and its residual is judged. It has "
                f"no parameters to change, so terms were fitted to its output. They ({terms}) {how}. Values and "
                f"predictions are those of this equivalent simulator.{notes}")

    def to_json(self) -> dict[str, Any]:
        return {"name": self.name, "sentence": self.sentence, "terms": [t.name for t in self.model.terms],
                "force_rms_m_s2": self.rms[0], "force_share": self.shares[0], "angular_rms_rad_s2": self.rms[1],
                "angular_share": self.shares[1], "alike": self.alike}


def along(track: Track, battery_V: float | None = None) -> Along:
    """A track as a simulator is given it; its arrays are copies."""
    volts = np.array(track.battery_V) if battery_V is None else np.full(len(track), battery_V)
    return Along(np.array(track.time_s), np.array(track.position_m), np.array(track.velocity_m_s),
                 np.array(track.quaternion), np.array(track.rate_rad_s), np.array(track.motor), volts, ROW_S)


def needs_battery(simulator: Simulator, track: Track, place: str) -> bool:
    """Whether the answer changes with the battery's voltage."""
    low, high = (run(simulator, along(_cut(track, 0, 100), v), place)
                 for v in (NO_BATTERY_V, NO_BATTERY_V + PROBED_V))
    return not all(np.array_equal(a, b) for a, b in zip(low, high, strict=True))


def turns_nothing(simulator: Simulator, track: Track, place: str) -> bool:
    """Whether the simulator gives forces alone: no angular acceleration at all."""
    return not run(simulator, along(track), place)[1].any()


def turning_by_motor(simulator: Simulator, track: Track, place: str) -> np.ndarray:
    """(3, rotors) mean angular acceleration in rad/s^2 that the simulator loses where one motor gives a little less, at
    the start of the track."""
    at = along(_cut(track, 0, PROBED_ROWS))
    still = run(simulator, at, place)[1]
    less = [1.0 - PROBED_SHARE * (np.arange(at.motor.shape[1]) == k) for k in range(at.motor.shape[1])]
    return np.stack([np.mean(still - run(simulator, replace(at, motor=at.motor * share), place)[1], axis=0)
                     for share in less], axis=1)


def equivalent(recordings: Recordings, simulator: Simulator, place: str, vehicle: Vehicle | None = None,
               progress: Callable[[str], None] | None = None) -> Equivalent:
    """The model equivalent to ``simulator`` along the recordings.

    ``vehicle``: known properties that the simulator does not state (mass, arms). Raises InputError for a simulator that
    fails (``given.run``), and for one with other units or axes.
    """
    say = progress or (lambda text: None)
    tracks = recordings.tracks
    say(f"{place} along {sum(len(t) for t in tracks)} rows")
    answers = [run(simulator, along(t), place) for t in tracks]
    wrench = Wrench(tracks)
    given = _compared(wrench, answers)
    _look_over(wrench, given, place)
    battery = needs_battery(simulator, tracks[0], place)
    own = getattr(simulator, "vehicle", None)
    if own is not None and not isinstance(own, Vehicle):
        raise InputError(place, f"its vehicle is a {type(own).__name__}", "give a nanobench_tools.physics.Vehicle")
    blocks = _blocks(tracks)
    part = Wrench([_cut(tracks[k], first, last) for k, first, last in blocks])
    target = _compared(part, [tuple(a[first:last] for a in answers[k]) for k, first, last in blocks])
    model = _fitted(part, target, _start(own or vehicle or Vehicle(), battery), say)
    made = wrench.model(model)
    gap = given[0] - made[0], given[1] - made[1]
    rms = tuple(float(np.sqrt(np.sum(g**2) / max(len(g), 1))) for g in gap)
    moves = tuple(float(np.sqrt(np.sum(g.var(axis=0)))) if len(g) else 0.0 for g in given)
    each = np.concatenate([np.sqrt(np.sum(g**2, axis=0) / max(len(g), 1)) / max(m, 1e-9)
                           for g, m in zip(gap, moves, strict=True)])
    return Equivalent(place, model, gap, (rms[0] / max(moves[0], 1e-9), rms[1] / max(moves[1], 1e-9)),
                      (rms[0], rms[1]), each, battery, tuple(getattr(simulator, "notes", ())))


def _compared(wrench: Wrench, answers: Sequence[tuple[np.ndarray, ...]]) -> tuple[np.ndarray, np.ndarray]:
    """Answers of a simulator through the filters of ``Wrench.model``."""
    force, turning = (np.concatenate([a[i] for a in answers]) for i in (0, 1))
    acceleration = so3.rotate(wrench.quaternion, force) - UP
    steps = np.arange(TORQUE_ROWS + 1)
    weight = np.where((steps == 0) | (steps == TORQUE_ROWS), 0.5, 1.0) / TORQUE_ROWS
    mean = np.einsum("k,nkc->nc", weight, turning[wrench.torque_at[:, None] + steps])
    return wrench._in_body(wrench._smooth(acceleration, 0)), mean


def _look_over(wrench: Wrench, given: tuple[np.ndarray, np.ndarray], place: str) -> None:
    """Units and axes. Raises InputError."""
    up = so3.rotate_inverse(wrench.quaternion[wrench.force_at], UP)[:, 2]
    flown, lifts = float(np.mean(wrench.measured[0][:, 2] + up)), float(np.mean(given[0][:, 2] + up))
    if not 1.0 / LIFTS < lifts / flown < LIFTS:
        times = lifts / flown
        guess = ("is gravity in it? return it, in the world, as {'acceleration_m_s2': ...}" if abs(times) < 0.02 else
                 "is it in g?" if abs(times * UP[2] - 1.0) < 0.5 else
                 "is it a force in N? divide it by the mass" if 0.0 < times < 0.2 else
                 "is z down?" if times < 0.0 else "another vehicle, or other units")
        raise InputError(place, f"its specific force along the body's z is {lifts:.3g} m/s^2 on average where these "
                         f"flights have {flown:.3g}", guess)
    if wrench.unasked:
        return
    asked, turned = given[1], wrench.measured[1]
    times = float(np.median(asked[:, :2].std(axis=0) / np.maximum(turned[:, :2].std(axis=0), 1e-9)))
    if not TURNS[0] < times < TURNS[1]:
        guess = ("is it in degrees?" if times > 1.0 else "does it look at the motors?" if times == 0.0 else
                 "is it a torque in N m? divide it by the inertia" if times < 1e-3 else
                 "another vehicle, or other units")
        raise InputError(place, f"its angular acceleration moves {times:.2g} times as much as that of these flights",
                         guess)
    for i, axis in enumerate("xy"):
        r = float(np.corrcoef(asked[:, i], turned[:, i])[0, 1])
        if r < AGAINST:
            raise InputError(place, f"it turns against what flew about {axis} (correlation {r:.2f})",
                             "body axes are x forward, y left, z up; motors front right, back right, back left, front "
                             "left")


def _cut(track: Track, first: int, last: int) -> Track:
    """Rows first to last, none of them judged before the rotors have warmed up."""
    arrays = {f: getattr(track, f)[first:last] for f in track.__dataclass_fields__
              if isinstance(getattr(track, f), np.ndarray)}
    counts = arrays["counts"].copy()
    if first > 0:
        counts[:round(BEFORE_S / ROW_S)] = False
    return replace(track, **{**arrays, "counts": counts})


def _blocks(tracks: Sequence[Track]) -> list[tuple[int, int, int]]:
    """(track, first row, last row) of the fitted blocks: all, or every k-th."""
    total = ROW_S * sum(len(t) for t in tracks)
    if total <= MOST_S:
        return [(k, 0, len(t)) for k, t in enumerate(tracks)]
    rows, warm = round(BLOCK_S / ROW_S), round(BEFORE_S / ROW_S)
    every = [(k, max(first - warm, 0), min(first + rows, len(t))) for k, t in enumerate(tracks)
             for first in range(0, len(t), rows) if t.counts[first:first + rows].any()]
    many = max(round(MOST_S / BLOCK_S), 1)
    return [every[i] for i in np.unique(np.linspace(0, len(every) - 1, many).round().astype(int))]


def _start(vehicle: Vehicle, battery: bool) -> Model:
    if battery:
        return Model(vehicle, start_of(vehicle))
    start = start_of(vehicle)
    c = np.array(start["thrust_voltage"]["c"])
    terms = {"thrust_pwm": {"c": tuple(c * NO_BATTERY_V ** np.arange(len(c)))}, **start}
    return Model(vehicle, {n: v for n, v in terms.items() if n != "thrust_voltage"})


def _fitted(wrench: Wrench, target: tuple[np.ndarray, np.ndarray], start: Model,
            say: Callable[[str], None]) -> Model:
    """Forward selection: add the term that explains most, until the rest is small or no term helps. Then drop idle
    terms."""
    space = space_around(start, wrench.unasked)
    held = [t for t in (*(t.name for t in start.terms), "inertia") if t not in wrench.unasked]
    say(f"terms that reproduce the simulator, from {ROW_S * sum(len(t) for t in wrench.tracks):.0f} s")
    scale = np.concatenate([np.full(target[0].size, TOLERANCE[0] * np.sqrt(target[0].size / 3.0)),
                            np.full(target[1].size, TOLERANCE[1] * np.sqrt(target[1].size / 3.0))])
    wanted = np.concatenate([part.ravel() for part in target])

    def left(values: np.ndarray) -> np.ndarray:
        return np.asarray((wanted - np.concatenate([p.ravel() for p in wrench.model(space.model, values)])) / scale)

    values, cost = _least(left, space, space.model.values, held)
    while cost > 2.0 and len(held) < len(start.terms) + 1 + MOST:
        others = [t for t in space.terms if t not in held and t not in NEVER]
        columns = {t: _columns(left, space, values, _free(space, [t])) for t in others}
        beside = _columns(left, space, values, _free(space, held))
        now = left(values)
        gains = {t: _explained(np.concatenate([beside, c], axis=1), now) for t, c in columns.items()}
        best = max(gains, key=lambda t: gains[t])
        tried, less = _least(left, space, values, [*held, best])
        if cost - less < LEAST_GAIN * cost:
            break
        held, values, cost = [*held, best], tried, less
        say(f"the simulator has {best}")
    rest = space.model.values
    for term in [t for t in held if t not in NEVER]:  # a term at rest in START has its neutral value
        still = _at_rest(space, values, term, rest)
        if still is not None and float(np.sum(left(still)**2)) - cost < IDLE:
            held, values = [t for t in held if t != term], still
            cost = float(np.sum(left(values)**2))
    values, _ = _least(left, space, values, held)
    found = space.model.with_values(values)
    return reduced(found, tuple(held), ())


def _at_rest(space: Space, values: np.ndarray, term: str, rest: np.ndarray) -> np.ndarray | None:
    """Values with a term at rest; None for a term without a value at rest."""
    still = values.copy()
    for i, slot in enumerate(space.model.slots):
        if slot.term.name == term:
            neutral = slot.parameter.neutral
            if neutral is None:
                return None
            still[i] = rest[i] if isinstance(neutral, str) else neutral
    return still


def _free(space: Space, terms: Sequence[str]) -> np.ndarray:
    """Free parameters, without those that are observable only in products or sums with another term."""
    slots = space.model.slots
    return np.array([i for i in free_of(space, terms) if slots[i].element not in slots[i].parameter.only_with], int)


def _columns(left: Callable[[np.ndarray], np.ndarray], space: Space, values: np.ndarray,
             free: np.ndarray) -> np.ndarray:
    """Slopes (K, F) of the residual, per scale."""
    sizes, here, found = scales(space.model), left(values), []
    for i in free:
        moved = values.copy()
        step = 1e-4 * sizes[i] * (1.0 if moved[i] + 1e-4 * sizes[i] <= space.model.upper[i] else -1.0)
        moved[i] += step
        found.append((left(moved) - here) * (sizes[i] / step))
    return np.stack(found, axis=1) if found else np.zeros((len(here), 0))


def _explained(columns: np.ndarray, left: np.ndarray) -> float:
    gram = columns.T @ columns
    size = np.sqrt(np.diag(gram))
    keep = size > 1e-9
    scaled = gram[np.ix_(keep, keep)] / np.outer(size[keep], size[keep])
    along_left = columns[:, keep].T @ left / size[keep]
    return float(along_left @ np.linalg.lstsq(scaled, along_left, rcond=1e-9)[0])


def _least(left: Callable[[np.ndarray], np.ndarray], space: Space, values: np.ndarray,
           terms: Sequence[str]) -> tuple[np.ndarray, float]:
    """Values with the parameters of some terms fitted, and the squared length of the residual."""
    free = _free(space, terms)
    sizes, model = scales(space.model)[free], space.model
    gains = np.array([bool(fixed_mean(model)[i]) for i in free], float)

    def whole(moved: np.ndarray) -> np.ndarray:
        vector = values.copy()
        vector[free] += moved * sizes
        return vector

    def asked(moved: np.ndarray) -> np.ndarray:
        return np.concatenate([left(whole(moved)), RIDGE * moved, [100.0 * float(gains @ (moved * sizes))]])

    def slope(moved: np.ndarray) -> np.ndarray:
        return np.concatenate([_columns(left, space, whole(moved), free), RIDGE * np.eye(len(free)),
                               100.0 * (gains * sizes)[None]])

    inside = 1e-6
    low, high = (model.lower[free] - values[free]) / sizes - inside, (model.upper[free] - values[free]) / sizes + inside
    found = least_squares(asked, np.zeros(len(free)), slope, bounds=(low, high), xtol=1e-6, ftol=1e-6, max_nfev=25)
    best = np.clip(whole(found.x), model.lower, model.upper)
    return best, float(np.sum(left(best)**2))
