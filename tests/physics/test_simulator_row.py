"""The exported simulator.toml as a row of Task 1, against an evaluation written from the documented equations alone:
TOML by the standard library, plain NumPy, rotations by SciPy; nothing of ``nanobench_tools.physics``."""

import tomllib

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from identification.greybox.fit_windows import cases_of
from nanobench_tools.flight import Span
from nanobench_tools.metrics.prediction import QUANTITIES
from nanobench_tools.physics.predictor import ModelPredictor
from nanobench_tools.protocols import task1
from nanobench_tools.protocols.windows import cut_windows
from nanobench_tools.sources.discover import load_recordings

pytestmark = pytest.mark.slow

FILE = """
schema = "nanobench-simulator/1"
[vehicle]
mass_kg = 0.04085
inertia_kg_m2 = [1.8e-05, 1.8e-05, 3.1e-05]
motor_positions_m = [[0.0325, -0.0325], [-0.0325, -0.0325], [-0.0325, 0.0325], [0.0325, 0.0325]]
spin = [-1.0, 1.0, -1.0, 1.0]
gravity_m_s2 = 9.81
input = "pwm"
rate_hz = 100.0
[[terms]]
name = "motor_imbalance"
g = [1.036, 0.987, 1.045, 0.932]
[[terms]]
name = "thrust_voltage"
c = [0.0056, 0.0368, -0.0016]
[[terms]]
name = "command_delay"
delay_s = 0.0342
[[terms]]
name = "motor_lag"
tau_up_s = 0.0293
tau_down_s = 0.0369
[[terms]]
name = "drag_linear"
d = [0.0105, 0.0105, 0.0032]
[[terms]]
name = "inertia"
inertia_kg_m2 = [3.67e-05, 3.46e-05, 3.1e-05]
[[terms]]
name = "yaw_torque"
k_m = 0.003
[[terms]]
name = "angular_damping"
d_r = [3.1e-4, 2.4e-4, 1.2e-4]
[[terms]]
name = "drag_torque"
c = -3.0e-4
"""
FINE = 8
"""Steps in a row of 10 ms: the evaluation below is finer than ``rate_hz`` asks, so that it needs none of its care."""


def evaluated(text, windows):
    """Positions, velocities, rotations (list over rows) and rates after rows 1..H, of all windows at once.

    T_i = g_i sum c_k (u_i V)^k of u(t - d); tau dT/dt = T_cmd - T with tau up and down; m dv/dt = R (sum T e3 - d v_b)
    - m g e3; J dw/dt = sum r_i x T_i e3 + spin k_m T - D w + c e3 x v_b - w x J w; RK4.
    """
    file = tomllib.loads(text)
    vehicle, term = file["vehicle"], {entry["name"]: entry for entry in file["terms"]}
    m, g0, spin = vehicle["mass_kg"], vehicle["gravity_m_s2"], np.array(vehicle["spin"])
    arm = np.array(vehicle["motor_positions_m"])
    j = np.array(term["inertia"]["inertia_kg_m2"])
    c, delay = term["thrust_voltage"]["c"], term["command_delay"]["delay_s"]
    gain = np.array(term["motor_imbalance"]["g"])
    up, down = term["motor_lag"]["tau_up_s"], term["motor_lag"]["tau_down_s"]
    row_s = 1.0 / windows.rate_hz
    u = np.concatenate([windows.motor_past, windows.motor], axis=1)
    volts = np.concatenate([windows.battery_past, windows.battery_V], axis=1)
    before = windows.motor_past.shape[1]

    def asked(t):
        """N, at t seconds from the start: the voltage of now and the command of then, held over its row."""
        then = int(np.clip(np.floor((t - delay) / row_s + 1e-9) + before, 0, u.shape[1] - 1))
        now = int(np.clip(np.floor(t / row_s + 1e-9) + before, 0, u.shape[1] - 1))
        motor = u[:, then] * volts[:, now, None]
        return gain * sum(ck * motor**k for k, ck in enumerate(c))

    def followed(thrust, wanted):
        return (wanted - thrust) / np.where(wanted > thrust, up, down)

    def slope(state, wanted):
        v, turn, w, thrust = state
        v_b = turn.inv().apply(v)
        force = -np.array(term["drag_linear"]["d"]) * v_b
        force[:, 2] += thrust.sum(axis=1)
        moment = np.stack([thrust @ arm[:, 1], -thrust @ arm[:, 0], term["yaw_torque"]["k_m"] * thrust @ spin], axis=1)
        moment += term["drag_torque"]["c"] * np.stack([-v_b[:, 1], v_b[:, 0], 0.0 * v_b[:, 0]], axis=1)
        moment -= np.array(term["angular_damping"]["d_r"]) * w + np.cross(w, j * w)
        return turn.apply(force) / m - [0.0, 0.0, g0], w, moment / j, followed(thrust, wanted)

    step = row_s / FINE
    thrust = asked(-before * row_s)  # at the first row before the start the rotors have settled
    for i in range(before * FINE):
        wanted = asked(-before * row_s + (i + 0.5) * step)
        middle = thrust + 0.5 * step * followed(thrust, wanted)
        thrust = thrust + step * followed(middle, wanted)
    p, state = windows.position_m, (windows.velocity_m_s, Rotation.from_quat(windows.quaternion), windows.rate_rad_s,
                                    thrust)
    found = []

    def ahead(state, h, k):
        return (state[0] + h * k[0], state[1] * Rotation.from_rotvec(h * k[1]), state[2] + h * k[2],
                state[3] + h * k[3])

    for i in range(windows.horizon * FINE):
        wanted = asked((i + 0.5) * step)
        k1 = slope(state, wanted)
        k2 = slope(ahead(state, 0.5 * step, k1), wanted)
        k3 = slope(ahead(state, 0.5 * step, k2), wanted)
        k4 = slope(ahead(state, step, k3), wanted)
        mean = [(a + 2.0 * b + 2.0 * c_ + d) / 6.0 for a, b, c_, d in zip(k1, k2, k3, k4, strict=True)]
        p = p + step * (state[0] + step / 6.0 * (k1[0] + k2[0] + k3[0]))
        state = ahead(state, step, mean)
        if (i + 1) % FINE == 0:
            found.append((p, state[0], state[1], state[2]))
    return found


def sixteen(found, came):
    """{metric: {"1", "10", "50", "sum"}} by the published equations."""
    errors = np.zeros((4, len(found), len(came.position_m)))
    for h, (p, v, turn, w) in enumerate(found):
        errors[0, h] = np.linalg.norm(p - came.position_m[:, h], axis=1)
        errors[1, h] = np.linalg.norm(v - came.velocity_m_s[:, h], axis=1)
        errors[2, h] = (turn.inv() * Rotation.from_quat(came.quaternion[:, h])).magnitude()
        errors[3, h] = np.linalg.norm(w - came.rate_rad_s[:, h], axis=1)
    mean = errors.mean(axis=2)
    return {name: {**{str(h): mean[q, h - 1] for h in (1, 10, 50)}, "sum": mean[q].sum()}
            for q, name in enumerate(QUANTITIES)}


def agree(case, tmp_path, truth):
    (tmp_path / "simulator.toml").write_text(FILE)
    row_of = ModelPredictor.from_file(tmp_path / "simulator.toml")
    scored = [(case, task1.score(case, row_of, truth))]
    row = task1.tabulate(row_of, truth, scored)[0]
    windows, came = cut_windows(case.flight, case.spans, truth)
    expected = sixteen(evaluated(FILE, windows), came)
    for name in QUANTITIES:
        for key, value in expected[name].items():
            assert row.metrics[name][key] == pytest.approx(value, rel=0.02), (name, key)
    return row


def test_the_row_is_what_the_equations_say_on_a_practice_flight(crowd, tmp_path):
    flight = crowd.flight("fast figure_eight")
    middle = 0.5 * (flight.span.start_s + flight.span.end_s)
    row = agree(task1.Case(flight, (Span(middle - 4.0, middle + 4.0),), ("all",)), tmp_path, "onboard")
    assert row.n_windows > 50


@pytest.mark.real
@pytest.mark.parametrize("truth", ["onboard", "mocap"])
def test_the_row_is_what_the_equations_say_on_real_windows(real_data, tmp_path, truth):
    flights = load_recordings([real_data / "nanobench"]).flights
    chosen = next(f for f in flights if (f.metadata.get("family"), f.metadata.get("speed")) == ("figure_eight", "fast"))
    row = agree(cases_of([chosen])[0], tmp_path, truth)
    assert row.n_windows > 100
