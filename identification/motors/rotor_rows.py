"""Flights with measured rotor speed and PWM, as rows at the rate of the log, cut at its gaps.

Rows are taken as evenly spaced. A log that is written once per control loop runs on the loop's clock, and its
timestamps only scatter around it. Everything else is interpolated at the timestamps of the motor stream. Only flying
rows count: all rotors spin and the vehicle moves. The log need not contain the time on the ground.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from nanobench_tools import so3
from nanobench_tools.auditing.usable import MOTORS, missing, tidy
from nanobench_tools.auditing.verb_needs import MOTOR_LAG
from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight
from nanobench_tools.settings import number, setting
from nanobench_tools.units import PWM_FULL_SCALE

GYRO = ("gyro_x", "gyro_y", "gyro_z")
STATE = {"estimator": ("x", "y", "z", "vx", "vy", "vz"), "attitude_qw": ("qx", "qy", "qz", "qw")}

SLOWEST_HZ = number("motors.rotor_rows.slowest_hz")

GAP = number("motors.rotor_rows.gap")
SHORTEST_S = number("motors.rotor_rows.shortest_s")
SPINNING_RAD_S = number("motors.rotor_rows.spinning_rad_s")
SHARE_OF_FLYING = number("motors.rotor_rows.share_of_flying")
NOT_MEASURED_SHARE = number("motors.rotor_rows.not_measured_share")
SMOOTH_S = number("motors.rotor_rows.smooth_s")
STANDING = setting("motors.rotor_rows.standing")
STEADY_PWM = 200.0 / PWM_FULL_SCALE
STEADY_V = number("motors.rotor_rows.steady_v")
SAME_RATE = number("motors.rotor_rows.same_rate")
USUAL = number("motors.rotor_rows.usual")


@dataclass(frozen=True)
class Log:
    """n rows ``row_s`` apart within each of ``stretches`` [(first, end)].

    ``u`` (n, 4): PWM ratio; ``speed`` (n, 4) rad/s; both of motors 1..4. ``battery_V`` (n,). ``rate`` (n, 3) rad/s and
    force_z (n,) m/s^2, body. ``state`` (n, 10): position, velocity, quaternion of the vehicle's estimate, or None.
    ``stamps`` (n,) s as logged. ``epoch_s``: timestamp of the recording.
    """

    name: str
    path: str
    row_s: float
    stamps: np.ndarray
    u: np.ndarray
    speed: np.ndarray
    battery_V: np.ndarray
    rate: np.ndarray
    force_z: np.ndarray
    state: np.ndarray | None
    stretches: tuple[tuple[int, int], ...]
    epoch_s: float = 0.0
    notes: tuple[str, ...] = ()

    @property
    def rows(self) -> int:
        return sum(end - first for first, end in self.stretches)

    @property
    def seconds(self) -> float:
        return self.rows * self.row_s

    def joined(self, values: np.ndarray) -> np.ndarray:
        """Rows of all stretches one after another."""
        return np.concatenate([values[a:b] for a, b in self.stretches])

    def windows(self, rows: int, every: int, before: int = 0) -> np.ndarray:
        """First rows of windows of ``rows`` rows with ``before`` rows ahead of them, all inside one stretch."""
        return np.concatenate([np.arange(a + before, max(b - rows + 1, a + before), every)
                               for a, b in self.stretches] or [np.empty(0, int)])


def read_logs(flights: Iterable[Flight]) -> tuple[list[Log], dict[str, str]]:
    """(logs at one common row_s, reasons by name of the invalid recordings); of equal recordings the first."""
    logs: list[Log] = []
    reasons: dict[str, str] = {}
    for flight in flights:
        try:
            log = read_log(flight)
        except InputError as error:
            reasons[flight.name] = error.found + (f"; {error.advice}" if error.advice else "")
            continue
        twin = next((other.name for other in logs if _same(log, other)), None)
        if twin is None:
            logs.append(log)
        else:
            reasons[flight.name] = f"copy of {twin}"
    if not logs:
        return [], reasons
    row_s = float(np.median([log.row_s for log in logs]))
    for log in [log for log in logs if abs(log.row_s / row_s - 1.0) > SAME_RATE]:
        reasons[log.name] = f"logged at {1.0 / log.row_s:.0f} Hz, the others at {1.0 / row_s:.0f} Hz"
        logs.remove(log)
    return [replace(log, row_s=row_s) for log in logs], reasons


def read_log(flight: Flight) -> Log:
    """The flying rows of a recording. InputError, one line, where nothing can be learned from it."""
    place = flight.provenance.path
    lacking = missing(flight, MOTOR_LAG)
    if lacking is not None:
        raise InputError(place, lacking, _advice(lacking))
    flight = tidy(flight, MOTOR_LAG)
    lacking = missing(flight, MOTOR_LAG)
    if lacking is not None:
        raise InputError(place, lacking, "its rows hold no numbers")
    stamps = flight["motor"].time_s
    steps = np.diff(stamps)
    typical = float(np.median(steps))
    row_s = float(np.mean(steps[steps < GAP * typical]))
    if row_s > 1.0 / SLOWEST_HZ:
        raise InputError(place, f"PWM logged at {1.0 / row_s:.0f} Hz",
                         f"a motor lag of tens of milliseconds needs {SLOWEST_HZ:.0f} Hz, such as a uSD log")
    u = np.clip(flight["motor"][MOTORS], 0.0, 1.0)
    speed = flight["rpm"].interpolate(MOTORS, stamps)
    imu = flight["imu"]
    rate, force_z = imu.interpolate(GYRO, stamps), imu.interpolate("acc_z", stamps)
    state = _state(flight, stamps)
    _measured(place, u, speed)
    flying = _flying(speed, row_s)
    edges = np.flatnonzero((steps > GAP * typical) | (flying[1:] != flying[:-1])) + 1
    pieces = zip([0, *edges.tolist()], [*edges.tolist(), len(stamps)], strict=True)
    stretches = tuple((a, b) for a, b in pieces if flying[a] and (b - a) * row_s >= SHORTEST_S)
    log = Log(flight.name, place, row_s, stamps, u, speed, flight["battery"].interpolate("vbat", stamps), rate, force_z,
              state, stretches, flight.epoch_s)
    if not stretches:
        raise InputError(place, f"no {SHORTEST_S} s with all rotors spinning", "a flight is needed")
    _informs(log)
    return log


def _advice(lacking: str) -> str:
    if "rpm" in lacking:
        return "log the rotor speeds (rpm.m1 to rpm.m4, RPM deck or ESC telemetry)"
    if "battery" in lacking:
        return "log pm.vbat: without voltage the PWM says little about speed"
    return "log PWM, rotor speed, gyro and accelerometer together"


def _measured(place: str, u: np.ndarray, speed: np.ndarray) -> None:
    """InputError when a rotor's speed is not there while it is driven like the others, or when a motor is dead."""
    usual = np.median(speed, axis=1)
    running = usual > SPINNING_RAD_S
    if not running.any():
        raise InputError(place, "no rotor ever spins", "a flight is needed")
    for i in range(4):
        others = np.median(np.delete(u, i, axis=1)[running], axis=0).mean()
        slow = float(np.mean(speed[running, i] < SHARE_OF_FLYING * usual[running]))
        if slow > NOT_MEASURED_SHARE:
            driven = np.median(u[running, i]) > SHARE_OF_FLYING * others
            what = "although its PWM is like the others'" if driven else "and its PWM is off"
            advice = "its rotor speed was not measured" if driven else "the motor is dead"
            raise InputError(place, f"motor {i + 1} shows less than half the others' speed in {100 * slow:.0f} % of "
                             f"the rows, {what}", advice)


def _flying(speed: np.ndarray, row_s: float) -> np.ndarray:
    """(n,) bool: all rotors at a good share of the speed they fly with."""
    squares = uniform_filter1d(np.sum(speed**2, axis=1), max(round(SMOOTH_S / row_s), 1))
    usual = np.quantile(squares[squares > 4.0 * SPINNING_RAD_S**2], USUAL)
    return np.asarray((squares > SHARE_OF_FLYING * usual) & (speed > SPINNING_RAD_S).all(axis=1))


def _informs(log: Log) -> None:
    """Raises InputError for rows that cannot distinguish a motor from a constant."""
    rate = np.quantile(np.linalg.norm(log.joined(log.rate), axis=1), 0.95)
    moving = 0.0 if log.state is None else np.quantile(np.linalg.norm(log.joined(log.state[:, 3:6]), axis=1), 0.95)
    if rate < STANDING[0] and moving < STANDING[1]:
        raise InputError(log.path, f"is at rest on the ground: body rate below {rate:.3f} rad/s with the rotors "
                                   "running",
                         "a flight is needed")
    if log.joined(log.u).std(axis=0).max() < STEADY_PWM:
        raise InputError(log.path, "PWM never changes while it flies", "a lag needs commands that move")
    voltage = log.joined(log.battery_V)
    if np.ptp(voltage) < STEADY_V:
        raise InputError(log.path, f"the battery voltage never changes ({voltage[0]:.3f} V)", "it was not measured")


def _state(flight: Flight, stamps: np.ndarray) -> np.ndarray | None:
    """(n, 10) position, velocity, quaternion of the onboard estimate; None where it was not logged."""
    if missing(flight, STATE) is not None:
        return None
    flight = tidy(flight, STATE)
    moves, turns = flight["estimator"], flight["attitude_qw"]
    quaternion = so3.interpolate(turns.time_s, turns[STATE["attitude_qw"]], stamps)
    return np.concatenate([moves.interpolate(STATE["estimator"], stamps), quaternion], axis=1)


def _same(a: Log, b: Log) -> bool:
    return len(a.stamps) == len(b.stamps) and np.array_equal(a.u, b.u) and np.array_equal(a.speed, b.speed)
