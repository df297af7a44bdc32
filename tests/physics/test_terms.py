"""Every term against a case worked out beside it, with other means: matrices of SciPy, np.cross, plain formulas."""

import numpy as np
import pytest
from physics_cases import ALL, CURVE, PWM_ONLY, SPEED, alone
from scipy.spatial.transform import Rotation

from nanobench_tools.lookup import registry
from nanobench_tools.physics import Model, Vehicle, find_term, neutral, numeric
from nanobench_tools.physics.model import QUATERNION, RATE, VELOCITY
from nanobench_tools.physics.rollout import rollout

MASS, GRAVITY, INERTIA = 0.04085, np.array([0.0, 0.0, -9.81]), np.array([1.8e-5, 1.8e-5, 3.1e-5])
X, Y = np.array([0.0325, -0.0325, -0.0325, 0.0325]), np.array([-0.0325, -0.0325, 0.0325, 0.0325])
SPIN = np.array([-1.0, 1.0, -1.0, 1.0])
BATTERY = 3.7
U = np.array([0.80, 0.75, 0.70, 0.85])
TURN = Rotation.from_euler("xyz", [0.3, -0.5, 1.1])
V = np.array([1.2, -0.7, 0.4])
W = np.array([0.9, -2.0, 1.5])
POSITION = np.array([0.4, -0.3, 0.08])


def curve(u=U):
    return np.polyval(CURVE["thrust_voltage"]["c"][::-1], u * BATTERY)


def accelerations(model: Model, thrust=(0.05, 0.06, 0.07, 0.08), inputs=(*U, BATTERY)):
    """(dv/dt, dw/dt, dT/dt) at the state of this file."""
    state = np.concatenate([POSITION, V, TURN.as_quat(), W, thrust])
    found = numeric.derivative(model, state[None], np.array([inputs]))[0]
    np.testing.assert_allclose(found[:3], V, rtol=0, atol=0)
    return found[VELOCITY], found[RATE], found[13:]


def expected(thrust, force_b=(0, 0, 0), torque=(0, 0, 0), force_w=(0, 0, 0), mass=MASS, inertia=INERTIA):
    """Newton and Euler in matrices."""
    body = np.array([0, 0, np.sum(thrust)]) + np.asarray(force_b)
    moment = np.array([np.sum(Y * thrust), -np.sum(X * thrust), 0.0]) + np.asarray(torque)
    j = np.diag(inertia)
    return (TURN.as_matrix() @ body + np.asarray(force_w)) / mass + GRAVITY, np.linalg.solve(
        j, moment - np.cross(W, j @ W))


def check(model: Model, thrust, **more):
    got = accelerations(model)
    for a, b in zip(got[:2], expected(thrust, **more), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12)


def with_terms(**terms):
    return Model(Vehicle(), {**CURVE, **terms})


def test_thrust_voltage():
    check(with_terms(), curve())


def test_thrust_pwm():
    c0, c1, c2 = PWM_ONLY["thrust_pwm"]["c"]
    check(alone("thrust_pwm"), c0 + c1 * U + c2 * U**2)


def test_coefficients_start_at_power_zero():
    check(Model(Vehicle(), {"thrust_pwm": {"c": [0.05]}}), np.full(4, 0.05))


def test_thrust_rpm():
    model = Model(Vehicle(input="rpm"), SPEED)
    omega = np.array([1500.0, 1600.0, 1700.0, 1800.0])
    state = np.concatenate([POSITION, V, TURN.as_quat(), W, np.zeros(4)])
    found = numeric.derivative(model, state[None], np.array([[*omega, BATTERY]]))[0]
    np.testing.assert_allclose(found[VELOCITY], expected(2.3e-8 * omega**2)[0], rtol=1e-12)


def test_thrust_rpm_with_pwm_changes_nothing():
    check(with_terms(**SPEED), curve())


def test_thrust_scale():
    check(with_terms(thrust_scale={"s": 0.9}), 0.9 * curve())


def test_mass():
    check(with_terms(mass={"m": 0.05}), curve(), mass=0.05)


def test_inertia():
    j = np.array([2e-5, 1.5e-5, 3.3e-5])
    check(with_terms(inertia={"inertia_kg_m2": j}), curve(), inertia=j)


def test_motor_lag_up_and_down():
    up, down, state = 0.02, 0.05, np.array([0.0, 0.2, 0.01, 0.3])
    model = with_terms(motor_lag={"tau_up_s": up, "tau_down_s": down})
    slope = accelerations(model, thrust=state)[2]
    np.testing.assert_allclose(slope, (curve() - state) / np.where(curve() > state, up, down), rtol=1e-12)
    got = accelerations(model, thrust=state)
    np.testing.assert_allclose(got[0], expected(state)[0], rtol=1e-12)


def test_motor_lag_of_zero_is_no_lag():
    check(with_terms(motor_lag={"tau_up_s": 0.0, "tau_down_s": 0.0}), curve())
    assert not accelerations(with_terms(motor_lag={"tau_up_s": 0.0, "tau_down_s": 0.0}))[2].any()


def test_command_delay_is_the_mean_of_the_shifted_input():
    """13 ms at 100 Hz: one whole row is shifted outside, and 3 of the 10 ms still have the row before."""
    model, before = alone("command_delay"), np.array([0.1, 0.2, 0.3, 0.4])
    got = accelerations(model, inputs=(*U, BATTERY, *before, 1.0))
    np.testing.assert_allclose(got[0], expected(curve(0.7 * U + 0.3 * before))[0], rtol=1e-12)


def test_motor_imbalance():
    g = np.array([1.1, 0.9, 1.05, 0.95])
    check(with_terms(motor_imbalance={"g": g}), g * curve())


def test_com_offset_turns_with_thrust_and_drag():
    r, d = np.array([0.002, -0.003, 0.004]), np.array([0.02, 0.03, 0.01])
    drag = -d * TURN.inv().apply(V)
    whole = drag + np.array([0, 0, curve().sum()])
    check(with_terms(com_offset={"r_m": r}, drag_linear={"d": d}), curve(), force_b=drag, torque=-np.cross(r, whole))


def test_yaw_torque():
    check(with_terms(yaw_torque={"k_m": 0.006}), curve(), torque=[0, 0, 0.006 * np.sum(SPIN * curve())])


def test_rotor_gyro():
    omega = np.sqrt(curve() / 2.3e-8)
    turning = np.array([0, 0, -2e-8 * np.sum(SPIN * omega)])
    check(with_terms(**SPEED, rotor_gyro={"J_r": -2e-8}), curve(), torque=-np.cross(W, turning))


def test_rotor_reaction_is_the_momentum_that_rotors_take_on():
    """Omega by differences of the rotors' own solution; drag and reaction push the body the same way."""
    lag, state, j_r = {"tau_up_s": 0.02, "tau_down_s": 0.05}, np.array([0.05, 0.2, 0.03, 0.3]), 3e-8
    bare = with_terms(**SPEED, motor_lag=lag)
    turned = [accelerations(m, thrust=state)[1] for m in (bare, bare.with_term("rotor_reaction", J_r=j_r))]

    def omega(after_s):
        goal = curve()
        tau = np.where(goal > state, lag["tau_up_s"], lag["tau_down_s"])
        return np.sqrt((goal + (state - goal) * np.exp(-after_s / tau)) / SPEED["thrust_rpm"]["k_f"])

    rise = (omega(1e-6) - omega(-1e-6)) / 2e-6
    np.testing.assert_allclose(turned[1] - turned[0], [0, 0, j_r * np.sum(SPIN * rise) / INERTIA[2]], rtol=1e-6)


def test_rotor_reaction_gives_the_body_what_the_rotors_take():
    """A step of the yaw command, long after: the body has J_r times what the rotors gained (momentum is kept)."""
    j_r = 3e-8
    model = with_terms(**SPEED, motor_lag={"tau_up_s": 0.02, "tau_down_s": 0.03}, rotor_reaction={"J_r": j_r})
    u = np.array([0.70, 0.80, 0.70, 0.80])
    start = np.zeros((1, 13))
    start[0, 9] = 1.0
    hover = np.full(4, 0.75)
    past = np.tile(hover, (1, 60, 1)), np.full((1, 60), BATTERY)
    states = rollout(model, start, np.tile(u, (1, 60, 1)), np.full((1, 60), BATTERY), past, row_hz=100.0)
    gained = np.sqrt(curve(u) / SPEED["thrust_rpm"]["k_f"]) - np.sqrt(curve(hover) / SPEED["thrust_rpm"]["k_f"])
    np.testing.assert_allclose(states[0, -1, 12] * INERTIA[2], j_r * np.sum(SPIN * gained), rtol=5e-3)


def test_rotors_that_follow_at_once_have_no_reaction():
    check(with_terms(**SPEED, rotor_reaction={"J_r": 3e-8}), curve())


def test_rotor_speed_is_the_measured_one_on_rpm():
    """Scale and imbalance belong to k_f there: drag_rotor sees the speeds that were given."""
    omega = np.array([1500.0, 1600.0, 1700.0, 1800.0])
    model = Model(Vehicle(input="rpm"), {**SPEED, "thrust_scale": {"s": 0.8}, "drag_rotor": {"d": [1e-6] * 3},
                                         "motor_imbalance": {"g": [1.1, 0.9, 1.0, 1.0]}})
    state = np.concatenate([POSITION, V, TURN.as_quat(), W, np.zeros(4)])
    found = numeric.derivative(model, state[None], np.array([[*omega, BATTERY]]))[0]
    thrust = 0.8 * np.array([1.1, 0.9, 1.0, 1.0]) * 2.3e-8 * omega**2
    force = -omega.sum() * 1e-6 * TURN.inv().apply(V)
    np.testing.assert_allclose(found[VELOCITY], expected(thrust, force_b=force)[0], rtol=1e-12)


def test_angular_damping():
    d = np.array([1e-5, 2e-5, 3e-5])
    check(with_terms(angular_damping={"d_r": d}), curve(), torque=-d * W)


def test_drag_linear():
    d = np.array([0.02, 0.03, 0.01])
    check(with_terms(drag_linear={"d": d}), curve(), force_b=-np.diag(d) @ TURN.as_matrix().T @ V)


def test_drag_rotor():
    d = np.array([1e-6, 2e-6, 3e-6])
    total = np.sqrt(curve() / 2.3e-8).sum()
    check(with_terms(**SPEED, drag_rotor={"d": d}), curve(), force_b=-total * d * TURN.inv().apply(V))


def test_drag_quadratic():
    q, v = np.array([0.003, 0.004, 0.005]), TURN.inv().apply(V)
    check(with_terms(drag_quadratic={"q": q}), curve(), force_b=-q * np.abs(v) * v)


def test_drag_torque():
    torque = -1.5e-4 * np.cross([0, 0, 1], TURN.inv().apply(V))
    check(with_terms(drag_torque={"c": -1.5e-4}), curve(), torque=torque)


def test_inflow():
    x, y, z = TURN.inv().apply(V)
    check(with_terms(inflow={"k_z": 0.05, "k_h": 0.01}), curve() * (1 - 0.05 * z + 0.01 * (x**2 + y**2)))


def test_ground_effect():
    share = 1 - 1.3 * (0.05 / (4 * POSITION[2])) ** 2
    check(with_terms(ground_effect={"rho": 1.3, "R": 0.05}), curve() / share)


def test_ground_effect_stays_finite_on_the_ground():
    state = np.concatenate([[0, 0, 0], V, TURN.as_quat(), W, np.zeros(4)])
    found = numeric.derivative(alone("ground_effect"), state[None], np.array([[*U, BATTERY]]))
    assert np.isfinite(found).all()


@pytest.mark.parametrize("drag", ["drag_linear", "drag_quadratic", "drag_rotor", "drag_torque"])
def test_wind_is_seen_by_drag(drag):
    """The vehicle in wind w flies as one with velocity v - w."""
    wind = np.array([0.5, -0.4, 0.3])
    terms = {**CURVE, **SPEED, drag: ALL[drag], "wind": {"w_m_s": wind}}
    got = accelerations(Model(Vehicle(), terms))
    state = np.concatenate([POSITION, V - wind, TURN.as_quat(), W, np.zeros(4)])
    still = numeric.derivative(Model(Vehicle(), {**CURVE, **SPEED, drag: ALL[drag]}), state[None],
                               np.array([[*U, BATTERY]]))[0]
    np.testing.assert_allclose(got[0], still[VELOCITY], rtol=1e-12)
    np.testing.assert_allclose(got[1], still[RATE], rtol=1e-12)


def test_inflow_takes_ground_velocity_in_wind():
    x, y, z = TURN.inv().apply(V)
    terms = with_terms(inflow={"k_z": 0.05, "k_h": 0.01}, drag_torque={"c": 0.0}, wind={"w_m_s": [5, 5, 5]})
    check(terms, curve() * (1 - 0.05 * z + 0.01 * (x**2 + y**2)))


def test_force_world():
    check(with_terms(force_world={"f_N": [0.01, -0.02, 0.03]}), curve(), force_w=[0.01, -0.02, 0.03])


def test_frame_tilt():
    """Rot_x(roll) Rot_y(pitch) between the body that is tracked and the one that thrust acts along."""
    tilt = Rotation.from_euler("x", 0.1) * Rotation.from_euler("y", -0.2)
    thrust = tilt.apply([0, 0, curve().sum()])
    got = accelerations(with_terms(frame_tilt={"roll_rad": 0.1, "pitch_rad": -0.2}))
    np.testing.assert_allclose(got[0], TURN.apply(thrust) / MASS + GRAVITY, rtol=1e-12)
    np.testing.assert_allclose(got[1], expected(curve())[1], rtol=1e-12)


def test_saturation_of_the_input():
    check(with_terms(saturation={"u_max": 0.78}), curve(np.minimum(U, 0.78)))


def test_saturation_of_the_thrust_comes_before_the_scale():
    check(with_terms(saturation={"T_max_N": 0.1}, thrust_scale={"s": 0.9}), 0.9 * np.minimum(curve(), 0.1))


def test_quaternion_rate_is_that_of_the_body_rate():
    state = np.concatenate([POSITION, V, TURN.as_quat(), W, np.zeros(4)])
    slope = numeric.derivative(with_terms(), state[None], np.array([[*U, BATTERY]]))[0][QUATERNION]
    h = 1e-6
    difference = ((TURN * Rotation.from_rotvec(W * h)).as_quat() - (TURN * Rotation.from_rotvec(-W * h)).as_quat())
    np.testing.assert_allclose(slope, difference / (2 * h), atol=1e-8)


@pytest.mark.parametrize("name", registry.names("terms"))
def test_neutral_values_change_nothing(name):
    term = find_term(name)
    values = neutral(term, Vehicle())
    base = {**CURVE, **SPEED, "drag_linear": ALL["drag_linear"]}
    if values is None:
        assert name in ("thrust_pwm", "thrust_voltage", "thrust_rpm", "slung_load")
        return
    terms = {**base, name: values}
    inputs = np.array([[*U, BATTERY, *U[::-1], 0.0][: 10 if name == "command_delay" else 5]])
    state = np.concatenate([POSITION, V, TURN.as_quat(), W, curve()])[None]
    got = numeric.step(Model(Vehicle(), terms), state, inputs)
    left = {other: terms[other] for other in terms if other != name}
    without = numeric.step(Model(Vehicle(), left), state, inputs[:, :5])
    np.testing.assert_allclose(got, without, rtol=1e-14, atol=1e-15)


@pytest.mark.parametrize("name", registry.names("terms"))
def test_every_term_is_described(name):
    term = find_term(name)
    assert term.name == name
    assert term.sentence.endswith((".", "sign."))
    assert term.equation
    assert term.confused_with
    for other in term.confused_with:
        assert other in (*registry.names("terms"), "clock_offset")
    for parameter in term.parameters:
        assert parameter.source
        assert parameter.unit
        assert parameter.lower < parameter.upper
        for value in np.atleast_1d(parameter.typical):
            assert parameter.lower <= value <= parameter.upper
