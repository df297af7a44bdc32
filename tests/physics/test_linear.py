"""The linear vehicle against transfer functions worked out by hand, and against the nonlinear one."""


import numpy as np
import pytest

from nanobench_tools.physics import Model, Vehicle, numeric
from nanobench_tools.physics.hover import hover, row_of, state_of
from nanobench_tools.physics.linear import linear_names, linearize, matrices

J, K_M, TAU_S = (1.6e-5, 1.8e-5, 3e-5), 0.0065, 0.05
MODEL = Model(Vehicle(mass_kg=0.04, inertia_kg_m2=J, input="thrust"), {
    "motor_lag": {"tau_up_s": TAU_S, "tau_down_s": TAU_S}, "yaw_torque": {"k_m": K_M},
    "drag_linear": {"d": (0.02, 0.02, 0.0)}, "angular_damping": {"d_r": (1e-5, 1e-5, 1e-5)}})
ROLL, PITCH, YAW = (np.array(s) for s in ((-1, -1, 1, 1), (-1, 1, 1, -1), (-1, 1, -1, 1)))


@pytest.mark.parametrize(("axis", "sense", "gain"), [("x", ROLL, 4 * 0.0325 / J[0]), ("y", PITCH, 4 * 0.0325 / J[1]),
                                                     ("z", YAW, 4 * K_M / J[2])])
def test_rates_by_hand(axis, sense, gain):
    """rate / thrust = gain / ((tau s + 1) (s + d / J))."""
    at = 1j * np.array([0.5, 5.0, 30.0])
    damping = 1e-5 / J["xyz".index(axis)]
    system = linearize(MODEL)
    found = np.squeeze(system(at), None)[system.find_output(f"rate_{axis}")].T @ sense
    assert found == pytest.approx(gain / ((TAU_S * at + 1) * (at + damping)), rel=1e-9)


def test_a_turn_pulls_the_vehicle_over():
    """dv/dt = g turn - d/m v: nose down (positive about y) goes forward, right side down (positive about x) right."""
    a, _ = matrices(MODEL)
    names = linear_names(4)
    g = MODEL.vehicle.gravity_m_s2
    assert a[names.index("velocity_x"), names.index("turn_y")] == pytest.approx(g)
    assert a[names.index("velocity_y"), names.index("turn_x")] == pytest.approx(-g)
    assert a[names.index("velocity_x"), names.index("velocity_x")] == pytest.approx(-0.02 / 0.04)


@pytest.mark.parametrize("extra", [{}, {"com_offset": {"r_m": (0.002, -0.001, 0.003)}},
                                   {"wind": {"w_m_s": (1.0, 0.5, 0.0)}}])
def test_it_is_the_slope_of_the_nonlinear_one(extra):
    """Central differences of the NumPy equations, quaternions by the exponential map."""
    from scipy.spatial.transform import Rotation

    model = Model(MODEL.vehicle, {**MODEL.as_dict(), **extra})
    a, b = matrices(model)
    at = hover(model)
    rest = state_of(model, np.radians(at.roll_deg), np.radians(at.pitch_deg), np.array(at.thrust_N))[0]
    rest[2] = at.height_m
    upright = Rotation.from_quat(rest[6:10])

    def slope(z, u):
        state = np.concatenate([rest[:6] + z[:6], (upright * Rotation.from_rotvec(z[6:9])).as_quat(), z[9:12],
                                rest[13:] + z[12:]])
        found = numeric.derivative(model, state[None], row_of(model, np.array(at.motor) + u, at.battery_V))[0]
        return np.concatenate([found[:6], z[9:12], found[10:]])

    for matrix, size, call in ((a, 16, lambda e: slope(e, np.zeros(4))), (b, 4, lambda e: slope(np.zeros(16), e))):
        steps = 1e-6 * np.eye(size)
        by_differences = np.array([(call(e) - call(-e)) / 2e-6 for e in steps]).T
        assert matrix == pytest.approx(by_differences, rel=1e-4, abs=1e-4 * np.abs(matrix).max())


def test_a_delay_turns_the_phase_and_nothing_else():
    delay_s, at = 0.03, 1j * 20.0
    late = linearize(MODEL.with_term("command_delay", delay_s=delay_s))
    ratio = (late(at)[10] @ PITCH) / (linearize(MODEL)(at)[10] @ PITCH)
    assert abs(ratio) == pytest.approx(1.0)
    assert np.angle(ratio) == pytest.approx(-20.0 * delay_s, abs=np.radians(0.1))
    assert late.state_labels[-1] == "late_4_1"
    assert linearize(MODEL.with_term("command_delay", delay_s=delay_s), delay_order=0).nstates == 16


def test_without_a_lag_commands_turn_it_at_once():
    system = linearize(MODEL.without("motor_lag"))
    assert system.nstates == 12
    assert system.input_labels == ["motor_1", "motor_2", "motor_3", "motor_4"]
    rate = system.B[system.state_labels.index("rate_x")]
    assert rate @ ROLL == pytest.approx(4 * 0.0325 / J[0])


def test_a_lag_up_and_down_is_the_mean_of_both_rates():
    a, _ = matrices(MODEL.with_parameters({"motor_lag.tau_up_s": 0.04, "motor_lag.tau_down_s": 0.1}))
    assert a[12, 12] == pytest.approx(-(1 / 0.04 + 1 / 0.1) / 2)
