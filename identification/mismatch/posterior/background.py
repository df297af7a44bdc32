"""Background that is added to every set of effects: offsets of flights, unmodelled physics, and effects of logging.

Columns in groups; every group has one amplitude, in m/s^2 RMS. Functions of the discrepancy are those of a Gaussian
process, centred: an explicit constant would cancel against the thrust's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter
from scipy.spatial.distance import cdist

from nanobench_tools import so3
from nanobench_tools.physics import Model
from nanobench_tools.settings import count, number

from ..space import Space
from ..track import ROW_S
from ..wrench import FORCE_ROWS, TORQUE_ROWS, Wrench
from .effects import Effect
from .gain_error import gain_error

MOST = count("posterior.background.most")
WHOLE = number("posterior.background.whole")
POINTS = 500
"""Rows from which the functions of a Gaussian process are made."""
PLACE_LENGTH = number("posterior.background.place_length")
AIR_LENGTH = number("posterior.background.air_length")
THRUST_LENGTH = 0.8
SLOWEST_S = number("posterior.background.shortest_period_s")
"""Shortest period of a disturbance that only time describes."""
DELAY_S = number("posterior.background.delay_s")
SHAKE = number("posterior.background.shake")
FAST_S = 0.3
"""Thrust that moves faster than this is logged with the shaking of the loop in it."""
TRACKED = number("posterior.background.tracked")
"""Of the distance of the rotors from the middle: standard deviation of that of the tracked point from the centre of
mass, along each axis."""
LATE_S = (0.06, 0.15, 0.4)
SLOW_LATE_S = (1.0, 3.0, 10.0, 25.0)
SAMPLE_S, STRETCH_S = ROW_S * FORCE_ROWS, ROW_S * TORQUE_ROWS
TRIMS = ("roll_trim", "pitch_trim", "yaw_trim")
LEVELS = ("tilt", "lift", *TRIMS)
"""Groups that differ from flight to flight."""
FORCES = ("place", "air", "thrust", "lean", "time", "late")
MOMENTS = ("turn_place", "turn_air", "turn_thrust", "turn_late", "yaw_place", "yaw_air", "yaw_thrust")
"""Groups of a force, and of a moment, that no effect explains."""
FIXED = "fixed"
"""Groups of amplitude 1: their columns have the size of a standard deviation."""
SWUNG = "swung"
"""Group of amplitude 1: acceleration of the tracked point against the centre of mass, per coordinate of it in the
body."""
LIFT_OF_ALL = "lift_of_all"
"""Small error of the thrust of all flights. It replaces the error of the thrust terms, which would also change gains of
torque. A set with such a term omits it: the two would cancel and leave a drag."""


@dataclass(frozen=True)
class Background:
    """``force`` (N, 3, Q) m/s^2, ``torque`` (M, 3, Q) rad/s^2, and the group (Q,) of each column."""

    force: np.ndarray
    torque: np.ndarray
    group: np.ndarray

    @property
    def groups(self) -> tuple[str, ...]:
        """Those whose amplitude is learnt."""
        return tuple(dict.fromkeys(g for g in self.group.tolist() if g not in (FIXED, SWUNG, LIFT_OF_ALL)))


def fast_part(values: np.ndarray, samples: float) -> np.ndarray:
    """(n, ...) values without what moves more slowly than so many samples."""
    return np.asarray(values - gaussian_filter1d(values, samples, axis=0, mode="nearest"))


def rms(columns: np.ndarray) -> np.ndarray:
    """(n, 3, ...) -> (...) root mean square of the length."""
    return np.asarray(np.sqrt((columns**2).sum(1).mean(0))) if len(columns) else np.zeros(columns.shape[2:])


def turning_size(columns: np.ndarray, arm: np.ndarray) -> np.ndarray:
    """(M, 3, ...) rad/s^2 -> m/s^2 RMS."""
    if not len(columns):
        return np.zeros(columns.shape[2:])
    weight = arm.reshape(3, *[1] * (columns.ndim - 2))
    return rms(columns * weight)


def smooth(inputs: np.ndarray, length: float) -> np.ndarray:
    """(n, k) centred leading functions of a Gaussian process of unit variance over inputs (n, d). Its length scale is
    ``length`` standard deviations. They hold WHOLE of its variance, or are MOST.

    By Nystroem's method, from POINTS of the rows. Source: Williams and Seeger 2001, Using the Nystroem method to speed
    up kernel machines. Random features of that number gave another verdict for another seed.
    """
    z = (inputs - inputs.mean(0)) / np.maximum(inputs.std(0), 1e-6)
    some = z[np.linspace(0, len(z) - 1, min(len(z), POINTS)).astype(int)]
    size, ways = np.linalg.eigh(_alike(some, some, length))
    size, ways = size[::-1], ways[:, ::-1]
    many = min(MOST, 1 + int(np.searchsorted(np.cumsum(size) / size.sum(), WHOLE)))
    found = _alike(z, some, length) @ (ways[:, :many] / np.sqrt(size[:many]))
    return np.asarray(found - found.mean(0))


def _varying(columns: np.ndarray, flight: np.ndarray) -> np.ndarray:
    """(n, ...) columns without their mean in each flight (n,)."""
    found = columns.copy()
    for one in np.unique(flight):
        found[flight == one] -= columns[flight == one].mean(0)
    return found


def _alike(one: np.ndarray, other: np.ndarray, length: float) -> np.ndarray:
    return np.asarray(np.exp(-0.5 * cdist(one, other, "sqeuclidean") / length**2))


class _Columns:
    def __init__(self, forces: int, torques: int) -> None:
        self.sizes = forces, torques
        self.force: list[np.ndarray] = []
        self.torque: list[np.ndarray] = []
        self.group: list[str] = []

    def add(self, name: str, force: np.ndarray | None = None, torque: np.ndarray | None = None) -> None:
        """(N, 3, k), (M, 3, k); None: no effect there."""
        many = next(c.shape[2] for c in (force, torque) if c is not None)
        self.force.append(np.zeros((self.sizes[0], 3, many)) if force is None else force)
        self.torque.append(np.zeros((self.sizes[1], 3, many)) if torque is None else torque)
        self.group += [name] * many

    def done(self) -> Background:
        return Background(np.concatenate(self.force, 2), np.concatenate(self.torque, 2), np.array(self.group))


def _on_axes(features: np.ndarray, axes: Sequence[int] = (0, 1, 2)) -> np.ndarray:
    """(n, k) -> (n, 3, k len(axes)): every feature along every axis."""
    eye = np.eye(3)[:, list(axes)]
    return np.asarray(np.einsum("nk,ij->nijk", features, eye).reshape(len(features), 3, -1))


def _beside(along: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """(n, 3, k) columns without the part along each axis that is proportional to ``along`` (n, 3).

    Drag along an axis is proportional to the velocity along it, and its moment to that across it. The amplitude of a
    discrepancy is learnt with these terms free, so it knows nothing of their size.
    """
    z = along - along.mean(0)
    slope = np.einsum("ni,nik->ik", z, columns) / np.maximum((z**2).sum(0), 1e-12)[:, None]
    return np.asarray(columns - z[:, :, None] * slope)


def reach_of(model: Model) -> float:
    """m: mean distance of the rotors from the middle."""
    return float(np.linalg.norm(np.asarray(model.vehicle.motor_positions_m)[:, :2], axis=1).mean())


def background_of(wrench: Wrench, space: Space, effects: Sequence[Effect], arm: np.ndarray) -> Background:
    """All columns of the background. ``arm``: ``arm_unit.arms``."""
    at, turns = wrench.force_at, wrench.torque_at
    quaternion = wrench.quaternion[at]
    frame = so3.matrix(quaternion)
    made = wrench.model(space.model)[0]
    found = _Columns(len(at), len(turns))

    def in_body(world: np.ndarray) -> np.ndarray:
        return np.asarray(np.einsum("nji,njk->nik", frame, world))

    _levels(found, wrench, effects, made, quaternion, arm)
    place, air = wrench.of("position_m", at), so3.rotate_inverse(quaternion, wrench.of("velocity_m_s", at))
    load = np.sqrt(np.mean(wrench.of("motor", at) ** 2, axis=1))
    found.add("place", in_body(_on_axes(_varying(smooth(place, PLACE_LENGTH), wrench.flight[at]))))
    found.add("air", _beside(air, _on_axes(smooth(air, AIR_LENGTH))))
    found.add("thrust", _on_axes(smooth(load[:, None], THRUST_LENGTH), [2]))
    found.add("lean", _lean(wrench, wrench.axes_smoothed[:, :2, 2]))
    reach = reach_of(space.model)
    found.add(SWUNG, TRACKED * reach * in_body(wrench.swung))
    found.add("time", in_body(_in_time(wrench, at)))
    found.add("late", _late(wrench, made[:, 2]))
    if len(turns):
        turned = wrench.quaternion[turns]
        there = so3.rotate_inverse(turned, wrench.of("velocity_m_s", turns))
        push = np.sqrt(np.mean(wrench.of("motor", turns) ** 2, axis=1))
        about = 1.0 / arm[None, :, None]
        at_place = _varying(smooth(wrench.of("position_m", turns), PLACE_LENGTH), wrench.flight[turns])
        across = there[:, [1, 0, 2]] * [1.0, 1.0, 0.0]
        in_air, by_thrust = smooth(there, AIR_LENGTH), smooth(push[:, None], THRUST_LENGTH)
        for name, axes in (("turn", (0, 1)), ("yaw", (2,))):  # yaw has little authority, and little that disturbs it
            for kind, features in (("place", at_place), ("air", in_air), ("thrust", by_thrust)):
                columns = _on_axes(features, axes)
                found.add(f"{name}_{kind}",
                          torque=about * (_beside(across, columns) if kind == "air" else columns))
        found.add("turn_late", torque=about * _on_axes(_fast_load(wrench, push)))
    _logging(found, wrench, space, effects, made, so3.rotate_inverse(quaternion, np.array([0.0, 0.0, 1.0])))
    return found.done()


def _levels(found: _Columns, wrench: Wrench, effects: Sequence[Effect], made: np.ndarray, quaternion: np.ndarray,
            arm: np.ndarray) -> None:
    """Each flight's deviation from the mean of all, per m/s^2: tilt of the markers, thrust as a whole, trim of the
    motors. A trim turns the vehicle in proportion to its thrust, whether motors or the centre of mass make it.

    The part that all flights share is excluded: large equal offsets would cancel against large effects.
    """
    flights = np.unique(wrench.flight)
    many = len(flights)
    up = so3.rotate_inverse(quaternion, np.array([0.0, 0.0, 1.0]))
    lift = next((e.force[..., 0] for e in effects if e.term == "thrust_scale"), (made + 9.81 * up) * [0.0, 0.0, 1.0])
    lift = lift / max(float(rms(lift)), 1e-6)
    found.add(LIFT_OF_ALL, lift[..., None])
    if many < 2:
        return
    beside = (np.eye(many) - 1.0 / many) * np.sqrt(many / (many - 1.0))
    each = (wrench.flight[wrench.force_at][:, None] == flights).astype(float) @ beside
    thrust = lift[:, 2:]
    tilt = np.zeros((len(made), 3, 2))
    tilt[:, 0, 0], tilt[:, 1, 1] = thrust[:, 0], thrust[:, 0]
    for axis in range(2):
        found.add("tilt", tilt[..., axis, None] * each[:, None, :])
    found.add("lift", lift[..., None] * each[:, None, :])
    if len(wrench.torque_at):
        turning = (wrench.flight[wrench.torque_at][:, None] == flights).astype(float) @ beside
        load = next((e.torque[:, 0, 1] for e in effects if e.term == "com_offset"), np.ones(len(turning)))
        turning *= load[:, None] / max(float(np.sqrt(np.mean(load**2))), 1e-9)
        for axis in range(3):
            column = np.zeros((len(turning), 3, len(flights)))
            column[:, axis] = turning / arm[axis]
            found.add(TRIMS[axis], torque=column)


def _lean(wrench: Wrench, thrust_axis: np.ndarray) -> np.ndarray:
    """(N, 3, k) force along z that is proportional to the lean towards x and y of the world, separate for each flight.
    ``thrust_axis`` (N, 2): horizontal components of body z.

    A world that is not level, or a thrust that depends on the place, does this. Of the terms, only the difference of
    a wind and a constant force does. Without these columns the two are taken large against each other.
    """
    lean = (thrust_axis - thrust_axis.mean(0)) / np.maximum(thrust_axis.std(0) * np.sqrt(2.0), 1e-6)
    flight = wrench.flight[wrench.force_at]
    return np.concatenate([_on_axes(lean * (flight == one)[:, None], [2]) for one in np.unique(flight)], 2)


def _in_time(wrench: Wrench, at: np.ndarray) -> np.ndarray:
    """(N, 3, k) slow cosines of time, world, separate for each flight."""
    flight, since = wrench.flight[at], wrench.of("since_s", at)
    parts = []
    for one in np.unique(flight):
        mine = flight == one
        start, span = since[mine].min(), max(float(np.ptp(since[mine])), 1.0)
        many = int(2.0 * span / SLOWEST_S)
        if many:
            wave = np.zeros((len(at), many))
            turns = np.arange(1, many + 1) * (since[mine, None] - start) / span
            wave[mine] = np.cos(np.pi * turns) * np.sqrt(2.0 / many)
            parts.append(_on_axes(wave))
    return np.concatenate(parts, 2) if parts else np.zeros((len(at), 3, 0))


def _late(wrench: Wrench, made: np.ndarray) -> np.ndarray:
    """(N, 3, k) thrust of the past along z: batteries, motors that warm up, lags that no term has."""
    thrust = made - made.mean()

    def lagged(tau_s: float) -> np.ndarray:
        keep = np.exp(-SAMPLE_S / tau_s)
        return _by_track(wrench, thrust, lambda x: lfilter([1.0 - keep], [1.0, -keep], x, zi=[keep * x[0]])[0])

    columns = [thrust - lagged(t) for t in LATE_S] + [lagged(t) for t in SLOW_LATE_S]
    return _along_z(np.stack([(c - c.mean()) / max(float(np.std(c)), 1e-6) for c in columns], axis=1))


def _fast_load(wrench: Wrench, push: np.ndarray) -> np.ndarray:
    """(M, k) fast part of the load: with a trim it turns the vehicle in a way that no lag or delay models exactly."""
    track = wrench.track[wrench.torque_at]
    found = np.zeros((len(push), len(LATE_S)))
    for one in np.unique(track):
        mine = track == one
        for k, tau_s in enumerate(LATE_S):
            keep = np.exp(-STRETCH_S / tau_s)
            x = push[mine]
            found[mine, k] = x - lfilter([1.0 - keep], [1.0, -keep], x, zi=[keep * x[0]])[0]
    return np.asarray(found / np.maximum(found.std(0), 1e-9))


def _by_track(wrench: Wrench, values: np.ndarray, change: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """(N,) values, those of each track changed by themselves."""
    found = np.zeros_like(values)
    track = wrench.track[wrench.force_at]
    for one in np.unique(track):
        mine = track == one
        found[mine] = change(values[mine])
    return found


def _along_z(columns: np.ndarray) -> np.ndarray:
    found = np.zeros((len(columns), 3, columns.shape[1]))
    found[:, 2] = columns
    return found


def _logging(found: _Columns, wrench: Wrench, space: Space, effects: Sequence[Effect], made: np.ndarray,
             up: np.ndarray) -> None:
    """Add columns of logging artefacts, each with the size of one standard deviation.

    Attitude and path, or command and row, belong to different moments. The speed of the rotors lags instead of their
    thrust. Thrust rises and falls equally fast. Drag acts at the rotors. Thrust shakes between rows, or has another
    slope.
    """
    model = space.model
    for force, torque in (wrench.speed_lag(model), wrench.drag_at_rotors(model), *_equal_lag(wrench, model)):
        found.add(FIXED, force[..., None], torque[..., None])
    turning = np.cross(wrench.of("rate_rad_s", wrench.force_at), made + 9.81 * up)
    found.add(FIXED, DELAY_S * turning[..., None])
    delay = next((e for e in effects if e.term == "command_delay"), None)
    if delay is not None:
        per_s = 1.0 / next(iter(delay.moves.values()))[0]
        found.add(FIXED, DELAY_S * per_s * delay.force[..., :1], DELAY_S * per_s * delay.torque[..., :1])
    thrust = made[:, 2]
    fast, followed = (_by_track(wrench, x, lambda part: fast_part(part, FAST_S / SAMPLE_S))
                      for x in (thrust, wrench.measured[0][:, 2]))
    noisy = gain_error(fast, followed, wrench.flight[wrench.force_at])
    for share, column in ((max(SHAKE, noisy), fast), (SHAKE, thrust - thrust.mean())):
        found.add(FIXED, share * _along_z(column[:, None]))


def _equal_lag(wrench: Wrench, model: Model) -> list[tuple[np.ndarray, np.ndarray]]:
    """Effects of one time constant in the place of two: of their geometric mean, and of half the way from there to the
    shorter one.

    A motor that coasts when its command falls far is driven up and down by small commands, and follows them equally
    fast.
    """
    times = model.values_of("motor_lag")
    up, down = times.get("tau_up_s", 0.0), times.get("tau_down_s", 0.0)
    if up == down:
        return []
    here, mean, short = (wrench.model(model.with_parameters({"motor_lag.tau_up_s": u, "motor_lag.tau_down_s": d}))
                         for u, d in ((up, down), (np.sqrt(up * down),) * 2, (min(up, down),) * 2))
    return [(mean[0] - here[0], mean[1] - here[1]), (0.5 * (short[0] - mean[0]), 0.5 * (short[1] - mean[1]))]
