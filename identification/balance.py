"""A vehicle to close loops with, from slow balances of force and moment along recordings.

The grey-box fit predicts windows and learns what the flight controller hides from it. Its reactions to the motors are
too small and its reaction in yaw vanishes, so such a model does not fly behind the firmware. A closed loop needs the
ruler to be the motors themselves. Below CUTOFF_HZ what they push is what is felt:

    m a_z = s sum T_i        m a_x = -d_x v_x, m a_y = -d_y v_y          (accelerometer, body)
    M_x = J_x dw_x/dt + d_r w_x + c v_y        M_y = J_y dw_y/dt + d_r w_y - c v_x    (moments of the motors, body)

T_i: the firmware's thrust curve of logged PWM and battery, behind the motors' lag. Constants of a flight (trim, bias)
are taken out flight by flight. Vertical drag cannot be distinguished from the thrust and is left out. Slow motion does
not identify lag, yaw moment and the ratio of inertias; their sources are below.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, lfilter, sosfiltfilt

from nanobench_tools import so3
from nanobench_tools.errors import InputError
from nanobench_tools.firmware.motor_output import YAW_ARM_M
from nanobench_tools.firmware.thrust_curve import COEFFICIENTS, thrust_of_voltage
from nanobench_tools.flight import Flight, Span, intersect_spans
from nanobench_tools.metrics.statistics import refit_weights
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.protocols.sessions import labels_of
from nanobench_tools.protocols.task1 import Case
from nanobench_tools.settings import count, number

CUTOFF_HZ = number("motors.balance.cutoff_hz")
GRID_S = 0.01
EDGE_S = number("motors.balance.edge_s")
SHORTEST_S = number("motors.balance.shortest_s")
LAG_S = number("motors.balance.lag_s")
YAW_INERTIA = 1.7
"""Inertia about z over that about x and y (firmware, Lee controller: 2.93e-5 over 1.66e-5 and 1.67e-5 kg m^2)."""
DRAWS = 200
CUT = count("motors.balance.cut")
MOTORS = ("m1", "m2", "m3", "m4")
SMALLEST_KG_M2 = 1e-6
BALANCES, WIDTH = 5, 3
"""Balances, and unknowns of each at most."""


@dataclass(frozen=True)
class Balance:
    """The model and ``draws`` (k, P) of its flat vector, sessions and then flights drawn with replacement. Also the
    explained share of the moments (x, y), and the number of flights used."""

    model: Model
    draws: np.ndarray
    explained: tuple[float, float]
    flights: int


def balance(cases: Sequence[Case], vehicle: Vehicle | None = None, seed: int = 0) -> Balance:
    """Parameters from whole flights. Raises InputError when none is long enough."""
    vehicle = vehicle or Vehicle()
    found = [(case.flight, part) for case in cases for part in [_equations(case, vehicle)] if part is not None]
    parts = [part for _, part in found]
    if not parts:
        raise InputError(cases[0].flight.provenance.path if cases else "data",
                         f"no flight of {SHORTEST_S + 2 * EDGE_S:g} s to identify a plant from")
    normal = [(np.array([a.T @ a for a, _ in rows]), np.array([a.T @ b for a, b in rows])) for rows in parts]
    whole = _solved(normal, np.ones(len(parts)))
    model = _model(whole, vehicle)
    counts = refit_weights(len(parts), labels_of([flight for flight, _ in found]), seed, DRAWS)
    drawn = [_model(_solved(normal, count), vehicle).values for count in counts]
    explained = tuple(1.0 - sum(float(np.sum((b - a @ whole[k]) ** 2)) for a, b in (rows[k] for rows in parts))
                      / sum(float(np.sum(rows[k][1] ** 2)) for rows in parts) for k in (1, 2))
    return Balance(model, np.array(drawn), (explained[0], explained[1]), len(parts))


def _equations(case: Case, vehicle: Vehicle) -> list[tuple[np.ndarray, np.ndarray]] | None:
    """(matrix (m, 3), right side (m,)) of thrust, moment x, moment y, drag x, drag y of one flight; None if too
    short."""
    if not case.spans:
        return None
    inner = Span(min(s.start_s for s in case.spans) + EDGE_S, max(s.end_s for s in case.spans) - EDGE_S)
    if inner.duration_s < SHORTEST_S:
        return None
    spans = [s for s in intersect_spans(case.spans, [inner]) if s.duration_s >= SHORTEST_S]
    parts = [_of_span(case.flight, span, vehicle) for span in spans]
    return [(np.concatenate([p[k][0] for p in parts]), np.concatenate([p[k][1] for p in parts]))
            for k in range(BALANCES)] if parts else None


def _of_span(flight: Flight, span: Span, vehicle: Vehicle) -> list[tuple[np.ndarray, np.ndarray]]:
    """The same of one clean span; constants over the span are taken out."""
    t = np.arange(span.start_s, span.end_s, GRID_S)
    volt = flight["motor"].interpolate(MOTORS, t) * flight["battery"].interpolate("vbat", t)[:, None]
    keep = np.exp(-GRID_S / LAG_S)
    commanded = thrust_of_voltage(volt)
    thrust = lfilter([1.0 - keep], [1.0, -keep], commanded, axis=0, zi=keep * commanded[:1])[0]
    attitude = flight["attitude_qw"]
    q = so3.interpolate(attitude.time_s, so3.make_continuous(attitude["qx", "qy", "qz", "qw"]), t)
    velocity = so3.rotate_inverse(q, flight["mocap"].interpolate(("vx", "vy", "vz"), t))
    arms = np.array(vehicle.motor_positions_m)
    sos = butter(2, CUTOFF_HZ * 2.0 * GRID_S, output="sos")

    def slow(x: np.ndarray) -> np.ndarray:
        return np.asarray(sosfiltfilt(sos, x, axis=0)[CUT:-CUT])

    thrust, velocity = slow(thrust), slow(velocity)
    rate = slow(flight["imu"].interpolate(("gyro_x", "gyro_y", "gyro_z"), t))
    force = vehicle.mass_kg * slow(flight["imu"].interpolate(("acc_x", "acc_y", "acc_z"), t))
    turning = np.gradient(rate, GRID_S, axis=0)
    moment = thrust @ np.stack([arms[:, 1], -arms[:, 0]], axis=1)
    none = np.zeros(len(rate))

    def rows(right: np.ndarray, *columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        matrix = np.stack([*columns, *[none] * (WIDTH - len(columns))], axis=1)
        return matrix - matrix.mean(axis=0), right - right.mean()

    total = np.stack([thrust.sum(axis=1), none, none], axis=1)
    return [(total, force[:, 2]), rows(moment[:, 0], turning[:, 0], rate[:, 0], velocity[:, 1]),
            rows(moment[:, 1], turning[:, 1], rate[:, 1], -velocity[:, 0]),
            rows(force[:, 0], -velocity[:, 0]), rows(force[:, 1], -velocity[:, 1])]


def _solved(normal: Sequence[tuple[np.ndarray, np.ndarray]], counts: np.ndarray) -> np.ndarray:
    """(5, 3) least squares over flights taken ``counts`` times."""
    left = np.sum([c * a for (a, _), c in zip(normal, counts, strict=True)], axis=0)
    right = np.sum([c * b for (_, b), c in zip(normal, counts, strict=True)], axis=0)
    return np.stack([np.linalg.lstsq(a, b, rcond=None)[0] for a, b in zip(left, right, strict=True)])


def _model(found: np.ndarray, vehicle: Vehicle) -> Model:
    """found (5, 3) as ``_equations`` orders it. Moments are the thrust curve's, so they scale with the thrust."""
    scale = float(found[0, 0])
    turn = scale * found[1:3]
    damping = float(max(turn[:, 1].mean(), 0.0))
    roll, pitch = (float(max(j, SMALLEST_KG_M2)) for j in turn[:, 0])
    drag = (*(float(max(d, 0.0)) for d in found[3:, 0]), 0.0)
    return Model(vehicle, {
        "thrust_voltage": {"c": COEFFICIENTS}, "thrust_scale": {"s": scale},
        "motor_lag": {"tau_up_s": LAG_S, "tau_down_s": LAG_S},
        "inertia": {"inertia_kg_m2": (roll, pitch, YAW_INERTIA * 0.5 * (roll + pitch))},
        "yaw_torque": {"k_m": float(YAW_ARM_M)}, "angular_damping": {"d_r": (damping,) * 3},
        "drag_linear": {"d": drag}, "drag_torque": {"c": float(turn[:, 2].mean())}})
