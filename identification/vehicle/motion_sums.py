"""Sums over one flight from which the parameters of the vehicle follow: what its motors push against what it feels.

The logged command is noisy (rows of 10 ms of a command that changes every 2 ms, packets lost). A controller also
answers every disturbance with it. The motion is clean. So the moment and the thrust of the command are on the left
side and the measured motion on the right. Noise of the command then widens intervals, but does not shrink gains
(errors in variables).

    s sum T_i = m a_z                                   mean over the flight, slow rows before fast ones
    m a_x = -d_x v_x, m a_y = -d_y v_y                  below SLOW_HZ, accelerometer
    s M_x = J_x dw_x/dt + d_r w_x + c v_y               below SLOW_HZ for c, in BAND_HZ for J
    s M_y = J_y dw_y/dt + d_r w_y - c v_x

T_i: the thrust curve of PWM times battery voltage, behind the motors' lag; means over a span are taken out of all but
the first. A flight without an accelerometer gives its force by the motion capture.
"""

from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, lfilter, sosfiltfilt

from nanobench_tools import so3
from nanobench_tools.flight import Flight, Span, intersect_spans
from nanobench_tools.physics import Vehicle
from nanobench_tools.protocols.task1 import Case
from nanobench_tools.settings import count, number, setting

GRID_S = 0.01
SLOW_HZ = number("vehicle.motion_sums.slow_hz")
BAND_HZ = setting("vehicle.motion_sums.band_hz")
"""Below it the moment of the air is most of the moment and its delay passes for inertia; above it noise is."""
EDGE_S = number("vehicle.motion_sums.edge_s")
EDGE_SHARE = number("vehicle.motion_sums.edge_share")
SHORTEST_S = number("vehicle.motion_sums.shortest_s")
LEAST_S = number("vehicle.motion_sums.least_s")
GROUND_S = number("vehicle.motion_sums.ground_s")
HOVER_M_S = number("vehicle.motion_sums.hover_m_s")
IDLE = number("vehicle.motion_sums.idle")
CUT = count("vehicle.motion_sums.cut")
MOTORS = ("m1", "m2", "m3", "m4")
FORCE = ("acc_x", "acc_y", "acc_z")


@dataclass(frozen=True)
class MotionSums:
    """Of one flight, thrust by a curve at scale 1.

    ``level``: force along body z over thrust, at hover. ``thrust_N`` (4,): mean of each motor. ``volts``: mean motor
    voltage. ``velocity_m_s`` (3,): mean, body. By axis x, y, integrals over time: drag (2, 3) of v v, -v F and F F;
    ``air`` (2, 5) of V V, V M, V D, V w and M M, below SLOW_HZ; ``turning`` (2, 5) of D D, D M, D w, D V and M M, in
    BAND_HZ. F: force; M: moment of the motors; ``w``: rate; D = dw/dt; V: the velocity that turns about the axis, v_y
    and -v_x.
    """

    name: str
    seconds: float
    level: float
    thrust_N: np.ndarray
    volts: float
    velocity_m_s: np.ndarray
    drag: np.ndarray
    air: np.ndarray
    turning: np.ndarray


@dataclass(frozen=True)
class Signals:
    """Rows GRID_S apart of a clean span. Volts (n, 4) at the motors, velocity (n, 3) m/s, rate (n, 3) rad/s and
    specific force (n, 3) m/s^2, body."""

    volts: np.ndarray
    velocity: np.ndarray
    rate: np.ndarray
    force: np.ndarray


def inner_spans(case: Case, edge_s: float = EDGE_S, shortest_s: float = SHORTEST_S) -> list[Span]:
    """Clean spans without the ends of the flight, none shorter than ``shortest_s``."""
    if not case.spans:
        return []
    first, last = min(s.start_s for s in case.spans), max(s.end_s for s in case.spans)
    edge_s = min(edge_s, EDGE_SHARE * (last - first))
    if last - first - 2.0 * edge_s < shortest_s:
        return []
    inner = intersect_spans(case.spans, [Span(first + edge_s, last - edge_s)])
    return [span for span in inner if span.duration_s >= shortest_s]


def signals(flight: Flight, span: Span, gravity_m_s2: float) -> Signals:
    """Of one span, interpolated."""
    t = np.arange(span.start_s, span.end_s, GRID_S)
    volts = flight["motor"].interpolate(MOTORS, t) * flight["battery"].interpolate("vbat", t)[:, None]
    attitude = flight["attitude_qw"]
    q = so3.interpolate(attitude.time_s, so3.make_continuous(attitude["qx", "qy", "qz", "qw"]), t)
    world = flight["mocap"].interpolate(("vx", "vy", "vz"), t)
    imu = flight["imu"]
    if all(name in imu for name in FORCE):
        force = imu.interpolate(FORCE, t)
    else:
        force = so3.rotate_inverse(q, np.gradient(world, GRID_S, axis=0) + np.array([0.0, 0.0, gravity_m_s2]))
    return Signals(volts, so3.rotate_inverse(q, world), imu.interpolate(("gyro_x", "gyro_y", "gyro_z"), t), force)


def lagged(thrust: np.ndarray, lag_s: float) -> np.ndarray:
    """(n, 4) behind a first-order lag."""
    keep = np.exp(-GRID_S / lag_s)
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], thrust, axis=0, zi=keep * thrust[:1])[0])


def motion_sums(case: Case, vehicle: Vehicle, curve: np.ndarray, lag_s: float,
                shortest_s: float = SHORTEST_S) -> MotionSums | None:
    """Of the inner spans of a flight; None where none is long enough. curve (K,) N/V^k of one motor."""
    parts = [_of_span(signals(case.flight, span, vehicle.gravity_m_s2), vehicle, curve, lag_s)
             for span in inner_spans(case, shortest_s=shortest_s)]
    if not parts:
        return None
    seconds = np.array([part.seconds for part in parts])

    def mean(name: str) -> np.ndarray:
        return np.asarray(np.average([getattr(part, name) for part in parts], axis=0, weights=seconds))

    def total(name: str) -> np.ndarray:
        return np.asarray(np.sum([getattr(part, name) for part in parts], axis=0))

    return MotionSums(case.flight.name, float(seconds.sum()), hover_level(case, vehicle, curve, lag_s),
                      mean("thrust_N"), float(mean("volts")), mean("velocity_m_s"), total("drag"), total("air"),
                      total("turning"))


def hover_level(case: Case, vehicle: Vehicle, curve: np.ndarray, lag_s: float) -> float:
    """Force along body z over the commanded thrust, without ground and idle motors. Rows at a speed v have the weight
    1 / (1 + (v / HOVER_M_S)^2)^2. Moving through the air costs thrust, and the level is that of hover."""
    rows = [signals(case.flight, span, vehicle.gravity_m_s2) for span in inner_spans(case, GROUND_S, GROUND_S)]
    thrust = np.concatenate([lagged(np.polynomial.polynomial.polyval(row.volts, curve), lag_s).sum(axis=1)
                             for row in rows])
    force = vehicle.mass_kg * np.concatenate([row.force[:, 2] for row in rows])
    speed = np.linalg.norm(np.concatenate([row.velocity for row in rows]), axis=1)
    weight = (thrust > IDLE * np.median(thrust)) / (1.0 + (speed / HOVER_M_S) ** 2) ** 2
    return float(weight @ force / (weight @ thrust))


def _of_span(found: Signals, vehicle: Vehicle, curve: np.ndarray, lag_s: float) -> MotionSums:
    thrust = lagged(np.polynomial.polynomial.polyval(found.volts, curve), lag_s)
    arms = np.array(vehicle.motor_positions_m)
    moment = thrust @ np.stack([arms[:, 1], -arms[:, 0]], axis=1)
    turning = np.gradient(found.rate, GRID_S, axis=0)[:, :2]
    across = np.stack([found.velocity[:, 1], -found.velocity[:, 0]], axis=1)
    force = vehicle.mass_kg * found.force

    slow, band = (butter(2, 2.0 * GRID_S * np.asarray(edge), kind, output="sos")
                  for edge, kind in ((SLOW_HZ, "low"), (BAND_HZ, "band")))

    def products(sos: np.ndarray, *columns: np.ndarray) -> np.ndarray:
        """(2, k + 1) sums of the first column times each, and of the second times itself; by axis, means taken out."""
        seen = [sosfiltfilt(sos, column, axis=0)[CUT:-CUT] for column in columns]
        seen = [column - column.mean(axis=0) for column in seen]
        pairs = [*((seen[0], column) for column in seen), (seen[1], seen[1])]
        return GRID_S * np.stack([np.sum(a * b, axis=0) for a, b in pairs], axis=1)

    drag = products(slow, found.velocity[:, :2], -force[:, :2])
    air = products(slow, across, moment, turning, found.rate[:, :2])
    quick = products(band, turning, moment, found.rate[:, :2], across)
    inner = slice(CUT, -CUT)
    return MotionSums("", len(thrust) * GRID_S, 1.0, thrust[inner].mean(axis=0), float(found.volts[inner].mean()),
                      found.velocity[inner].mean(axis=0), drag, air, quick)
