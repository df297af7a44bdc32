"""Whether a simulator's motor order and spin directions are physically possible, and those of the flights.

A wrong order looks like a wrong inertia or a weak motor to every later step, so it is checked before anything is
explained. There are two checks. The rotors must be able to hover in balance and to turn about every axis. The measured
angular acceleration must follow the motors in the pattern that the simulator's positions and spins give.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog
from scipy.signal import lfilter

from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.settings import number, setting

from .wrench import Wrench

SPINNING = ("yaw_torque",)
"""Terms by which the spin of a rotor turns the vehicle."""
FEWEST_ROTORS = 4
"""With three, a servo turns the vehicle about z, not the spin of its rotors."""
LEAST_SHARE = 0.1
"""A rotor that gives less than this share of the mean thrust in hover is as good as missing."""
LEAST_INDEPENDENT = 0.05
"""Smallest over largest singular value of the four unit patterns of rotors (lift, roll, pitch, yaw)."""
MOST_PERMUTED = 4
"""Rotors of which every order is tried; of more, only swaps of two."""
LAGS_S = (0.02, 0.05, 0.1)
"""Time constants of rotors, from a toy to half a metre; the one that fits best is taken."""
LEAST_YAW = 1e-4
"""A callable turns about yaw if it turns by more than this share of roll or pitch."""
CLEAR = number("mismatch.wiring.clear")
MASKED = setting("mismatch.wiring.masked")
AXES = ("roll", "pitch", "yaw")


@dataclass(frozen=True)
class Contradiction:
    """``key`` of the vehicle, what is wrong with it, and what to do."""

    key: str
    found: str
    advice: str


def impossible(model: Model) -> Contradiction | None:
    """Motor positions or spins with which no vehicle can fly; None if they are plausible."""
    vehicle = model.vehicle
    if vehicle.rotors < FEWEST_ROTORS:
        return None
    spins = any(name in model for name in SPINNING)
    rows = _patterns(vehicle)[: 3 if spins else 2]
    if spins and (same := _neighbours_alike(vehicle)) is not None and _dependent(rows):
        return Contradiction("spin", f"motors {same[0]} and {same[1]} are neighbours and spin the same way, so yaw "
                             "cannot be controlled without rolling or pitching",
                             "give neighbouring rotors opposite signs, and motor_positions_m in the order of the spins")
    if _dependent(rows):
        return Contradiction("spin" if spins else "motor_positions_m",
                             "the rotors cannot turn the vehicle about every axis",
                             "check the signs of spin and the positions, motor after motor")
    if (idle := _idle_in_hover(rows)) is not None:
        without = _idle_in_hover(rows[:2])
        return Contradiction("spin" if without is None else "motor_positions_m",
                             f"no hover is in balance in which motor {idle} carries its part",
                             "check the signs of spin and the positions, motor after motor")
    return None


def _patterns(vehicle: Vehicle) -> np.ndarray:
    """(3, rotors): how a newton of each rotor turns about roll, pitch and yaw, each row of length 1."""
    places = np.array(vehicle.motor_positions_m)
    rows = np.array([places[:, 1], -places[:, 0], np.array(vehicle.spin, float)])
    length = np.linalg.norm(rows, axis=1, keepdims=True)
    return np.asarray(rows / np.where(length > 0.0, length, 1.0))


def _dependent(rows: np.ndarray) -> bool:
    lift = np.full((1, rows.shape[1]), rows.shape[1] ** -0.5)
    size = np.linalg.svd(np.vstack([lift, rows]), compute_uv=False)
    return bool(size[-1] < LEAST_INDEPENDENT * size[0])


def _idle_in_hover(rows: np.ndarray) -> int | None:
    """Number of a rotor that no balanced hover uses; None where one uses all. The balance is held within a tenth of a
    rotor's turning, since the centre of mass may be off the middle."""
    n = rows.shape[1]
    slack = 0.1 * np.abs(rows).max(axis=1)
    most = linprog([0.0] * n + [-1.0],  # the smallest thrust, as large as it can be
                   A_ub=np.vstack([np.hstack([rows, np.zeros((len(rows), 1))]),
                                   np.hstack([-rows, np.zeros((len(rows), 1))]),
                                   np.hstack([-np.eye(n), np.ones((n, 1))])]),
                   b_ub=[*slack, *slack, *[0.0] * n], A_eq=[[1.0] * n + [0.0]], b_eq=[float(n)],
                   bounds=[(0.0, None)] * n + [(None, None)])
    if most.status == 0 and -most.fun >= LEAST_SHARE:
        return None
    return 1 if most.status != 0 else int(np.argmin(most.x[:n])) + 1


def _neighbours_alike(vehicle: Vehicle) -> tuple[int, int] | None:
    """Numbers of two neighbouring motors of a quadrotor that spin the same way."""
    if vehicle.rotors != FEWEST_ROTORS:
        return None
    around = np.argsort([np.arctan2(y, x) for x, y in vehicle.motor_positions_m])
    pairs = [(int(a), int(b)) for a, b in zip(around, np.roll(around, -1), strict=True)
             if vehicle.spin[a] == vehicle.spin[b]]
    return min((min(a, b) + 1, max(a, b) + 1) for a, b in pairs) if pairs else None


@dataclass(frozen=True)
class Wiring:
    """One assignment: ``order[i]`` is the simulator's motor that sits where motor i of the flights does; ``flipped``:
    all spins the other way."""

    order: tuple[int, ...]
    flipped: bool = False

    @property
    def sentence(self) -> str:
        """How the simulator differs."""
        moved = [i for i, k in enumerate(self.order) if i != k]
        spin = "every rotor spun the other way" if self.flipped else ""
        if not moved:
            return spin
        swaps = [(i, k) for i, k in enumerate(self.order) if i < k and self.order[k] == i]
        if 2 * len(swaps) == len(moved):
            order = " and ".join(f"motors {i + 1} and {k + 1} were swapped" for i, k in swaps)
        else:
            order = "motors " + ", ".join(str(i + 1) for i in range(len(self.order))) + " sat at the places of " + (
                ", ".join(str(k + 1) for k in self.order))
        return f"{order} and {spin}" if spin else order


def against_flights(wrench: Wrench, model: Model) -> Contradiction | None:
    """A wiring with which the rotation in the flights follows the motors, if it does not with the simulator's. None if
    the simulator's fits, or if the flights do not show it."""
    patterns = _patterns(model.vehicle)[: 3 if any(name in model for name in SPINNING) else 2]
    return _contradicted(wrench, patterns, model.vehicle.input)


def gains_against_flights(wrench: Wrench, gains: np.ndarray) -> Contradiction | None:
    """``against_flights`` of (3, rotors) angular acceleration that a simulator gives per motor (rad/s^2), which is
    commanded by PWM; None where it does not turn about roll and pitch."""
    length = np.linalg.norm(gains, axis=1, keepdims=True)
    if not np.all(length[:2] > 0.0):
        return None
    axes = 3 if length[2] > LEAST_YAW * length[:2].min() else 2
    return _contradicted(wrench, gains[:axes] / length[:axes], "pwm")


def _contradicted(wrench: Wrench, patterns: np.ndarray, commands: str) -> Contradiction | None:
    slopes = _slopes(wrench, patterns.shape[1], commands)
    if slopes is None:
        return None
    rotors = patterns.shape[1]
    found = {wiring: _follows(*slopes, _rewired(patterns, wiring)) for wiring in _wirings(rotors, len(patterns))}
    believed = found[Wiring(tuple(range(rotors)))]
    best = max(found, key=lambda wiring: _explained(found[wiring]))
    wrong = [axis for axis, ours, theirs in zip(AXES, believed, found[best], strict=False)
             if theirs > CLEAR and ours < MASKED * theirs]
    if not wrong:
        return None
    return Contradiction("spin" if best == Wiring(tuple(range(rotors)), True) else "motor_positions_m",
                         f"{' and '.join(wrong)} of the flights {'do' if len(wrong) > 1 else 'does'} not follow the "
                         f"simulator's motors, but would if {best.sentence}",
                         "check the order of motors and the signs of spin against the log's")


def _explained(follows: np.ndarray) -> float:
    """How much better a wiring explains the turning than no wiring. A part within chance does not count. If two wirings
    differ only in it, the first one is taken, which is simpler."""
    return float(np.sum(np.where(follows > 0.5 * CLEAR, follows, 0.0) ** 2))


def _wirings(rotors: int, axes: int) -> Iterator[Wiring]:
    same = tuple(range(rotors))
    orders: Sequence[tuple[int, ...]]
    if rotors <= MOST_PERMUTED:
        orders = list(itertools.permutations(same))
    else:
        orders = [same, *(tuple(b if k == a else a if k == b else k for k in same)
                          for a, b in itertools.combinations(same, 2))]
    for order in orders:
        yield Wiring(order)
        if axes > 2:
            yield Wiring(order, True)


def _rewired(patterns: np.ndarray, wiring: Wiring) -> np.ndarray:
    found = patterns[:, wiring.order].copy()
    if wiring.flipped:
        found[2] *= -1.0
    return found


def _slopes(wrench: Wrench, rotors: int, commands: str) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Angular acceleration per rotor thrust, (3, rotors), the inverse of its covariance up to the variance (rotors,
    rotors), and the variances (3,) left; None where turning is not compared.

    Thrust is that at the start of each stretch, so it excludes the controller's response to the stretch.
    """
    at = wrench.torque_at
    if len(at) < 10 * rotors:
        return None
    rows = np.arange(int(wrench.ends[-1]))
    motor, volts = wrench.of("motor", rows), wrench.of("battery_V", rows)[:, None]
    wanted = {"pwm": (motor * volts) ** 2, "rpm": motor**2}.get(commands, motor)
    track = wrench.track[at]
    turning = _centred(wrench.measured[1], track)
    best: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
    for lag_s in LAGS_S:
        thrust = _centred(_lagged(wanted, wrench, lag_s)[at], track)
        information = thrust.T @ thrust
        slopes = np.linalg.lstsq(thrust, turning, rcond=None)[0].T
        left = (turning - thrust @ slopes.T).var(axis=0)
        if best is None or left.sum() < best[2].sum():
            best = slopes, information, left
    return best


def _lagged(wanted: np.ndarray, wrench: Wrench, lag_s: float) -> np.ndarray:
    """Through a first-order lag, every track alone."""
    keep = float(np.exp(-0.01 / lag_s))
    parts = np.split(wanted, wrench.ends[:-1])
    return np.concatenate([lfilter([1.0 - keep], [1.0, -keep], part, axis=0, zi=keep * part[:1])[0] for part in parts])


def _centred(values: np.ndarray, track: np.ndarray) -> np.ndarray:
    """Values without the mean of every track: trim and steady torque are not compared."""
    found = values.copy()
    for k in np.unique(track):
        found[track == k] -= found[track == k].mean(axis=0)
    return found


def _follows(slopes: np.ndarray, information: np.ndarray, left: np.ndarray, patterns: np.ndarray) -> np.ndarray:
    """(axes,) standard deviations by which each axis follows its own pattern; negative where it follows the opposite.

    The fit includes the patterns of the other axes and a part that all rotors share.
    """
    basis = np.vstack([patterns, np.ones(slopes.shape[1])]).T
    inverse = np.linalg.pinv(basis.T @ information @ basis)
    gains = slopes[: len(patterns)] @ information @ basis @ inverse
    sd = np.sqrt(np.maximum(left[: len(patterns)] * np.diag(inverse)[: len(patterns)], 1e-30))
    return np.asarray(np.diag(gains) / sd)
