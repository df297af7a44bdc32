"""What predictive controllers believe of the vehicle, against compiled rollouts, finite differences and each other."""

import functools
import re
from dataclasses import replace

import numpy as np
import pytest

from controllers.mpc import casadi_code, prediction_model
from controllers.mpc.delay import UnderWay
from controllers.mpc.disturbance import Observer
from controllers.mpc.linear_mpc import error
from controllers.mpc.thrust_map import ThrustMap
from nanobench_tools import so3
from nanobench_tools.errors import InputError, MissingExtraError, how_to_install
from nanobench_tools.physics import numeric, rollout
from nanobench_tools.physics.model import Model

LAG_S = 0.06
MODEL = prediction_model.default_model().without("command_delay").with_parameters(
    {"motor_lag.tau_up_s": LAG_S, "motor_lag.tau_down_s": LAG_S})  # predictions know one lag


@functools.cache
def call(name, *arguments):
    return casadi_code.Call(getattr(prediction_model, name)(MODEL, *arguments))


def states(rng, n):
    """Tilted, moving, turning ones."""
    q = so3.exp(0.6 * rng.standard_normal((n, 3)))
    return np.concatenate([rng.standard_normal((n, 6)), q, 2.0 * rng.standard_normal((n, 3)),
                           0.1 + 0.02 * rng.standard_normal((n, 4))], axis=1)


def stepped(x, u, d=0.0, dt=0.025):
    step = call("step_function")
    for array, value in zip(step.given, (x, u, d, dt), strict=True):
        array[:] = value
    return step()[0][0].copy()


def test_a_prediction_is_the_rollout_of_the_model_behind_its_thrust_map():
    rng = np.random.default_rng(1)
    x, motor, volt = states(rng, 1), rng.uniform(0.6, 0.95, (1, 30, 4)), np.full((1, 30), 3.6)
    expected = rollout.rollout(MODEL, x, motor, volt)[0]
    made = numeric.equations(MODEL, 0.01)
    now = x[0]
    for j in range(30):
        now = stepped(now, np.array(made.command([*motor[0, j], 3.6])), dt=0.01)
        np.testing.assert_allclose(now, expected[j + 1], rtol=1e-9, atol=1e-10)


def test_a_disturbance_pushes_and_turns_by_what_it_says():
    x = np.zeros(17)
    x[9], x[13:] = 1.0, 0.1
    d = np.array([0.3, -0.2, 0.1, 2.0, -1.0, 0.5])
    change = stepped(x, np.full(4, 0.1), d, 1e-4) - stepped(x, np.full(4, 0.1), 0.0, 1e-4)
    np.testing.assert_allclose(change[3:6] / 1e-4, d[:3], rtol=1e-3)
    np.testing.assert_allclose(change[10:13] / 1e-4, d[3:], rtol=1e-3)


def moved(x, delta):
    out = x.copy()
    out[:6] += delta[:6]
    out[6:10] = so3.multiply(x[6:10], np.append(0.5 * delta[6:9], 1.0))
    out[6:10] /= np.linalg.norm(out[6:10])
    out[10:] += delta[9:]
    return out


@pytest.mark.parametrize("size", [12, 16])
def test_the_linearisation_is_that_of_finite_differences(size):
    rng = np.random.default_rng(2)
    n = 20
    x, ahead, u, d = states(rng, n), states(rng, n), rng.uniform(0.05, 0.12, (n, 4)), rng.standard_normal(6)
    if size == 12:
        x[:, 13:] = u  # thrust that acts at once
    stages = call("stages_function", n, 0.025, size)
    for array, value in zip(stages.given, (x, u, ahead, d), strict=True):
        array[:] = value
    c, a, b = stages()
    a, b = a.reshape(n, size, size), b.reshape(n, 4, size)

    def missed(k, delta):
        full = np.zeros(20)
        full[:size], full[16:] = delta[:size], delta[size:]
        start = moved(x[k], full[:16])
        if size == 12:
            start[13:] = u[k] + full[16:]
        return error(stepped(start, u[k] + full[16:], d), ahead[k])[:size]

    for k in range(3):
        np.testing.assert_allclose(c[k], missed(k, np.zeros(size + 4)), atol=1e-12)
        for j in range(size + 4):
            tiny = np.zeros(size + 4)
            tiny[j] = 1e-6
            slope = (missed(k, tiny) - missed(k, -tiny)) / 2e-6
            np.testing.assert_allclose((a[k, :, j] if j < size else b[k, j - size]), slope, rtol=1e-6, atol=2e-7)
    has_a, has_b = prediction_model.stage_pattern(MODEL, 0.025, size)
    assert not np.any(a[:, ~has_a])
    assert not np.any(b.transpose(0, 2, 1)[:, ~has_b])


def test_targets_fly_the_reference_under_the_disturbance():
    rng = np.random.default_rng(3)
    targets = call("targets_function", 2)
    d = np.array([0.4, -0.3, 0.2, 5.0, -4.0, 2.0])
    for _ in range(10):
        row = np.concatenate([rng.standard_normal(9), np.zeros(3), rng.uniform(-2.0, 2.0, 1), [0.0]])
        targets.given[0][:], targets.given[1][:] = row, d
        x, u = (found[0] for found in targets())
        np.testing.assert_allclose(x[:6], row[:6])
        slope = (stepped(x, u, d, 1e-5) - x) / 1e-5
        np.testing.assert_allclose(slope[3:6], row[6:9], atol=0.02)  # drag is solved for in two rounds
        np.testing.assert_allclose(slope[10:13], 0.0, atol=0.2)
        heading = so3.rotate(x[6:10], np.array([1.0, 0.0, 0.0]))
        assert abs(np.angle(np.exp(1j * (np.arctan2(heading[1], heading[0]) - row[12])))) < 0.3


def test_a_jerk_turns_the_target_as_its_attitude_changes():
    targets = call("targets_function", 2)
    a, j, dt = np.array([0.8, -0.5, 0.4]), np.array([1.5, 2.0, -1.0]), 1e-4
    rows = [np.concatenate([np.zeros(6), a + s * j * dt, j, [0.7 + s * 0.4 * dt, 0.4]]) for s in (0.0, 1.0)]
    targets.given[0][:], targets.given[1][:] = rows, 0.0
    x = targets()[0]
    turned = so3.log(so3.multiply(so3.conjugate(x[0, 6:10]), x[1, 6:10])) / dt
    np.testing.assert_allclose(x[0, 10:12], turned[:2], atol=0.02)


@pytest.mark.parametrize("lengths", [(), (3,)])
def test_commands_under_way_are_flown_one_after_the_other(lengths):
    """Compiled whole or one by one: SciPy's integration of each in turn is ``stepped``'s test."""
    rng = np.random.default_rng(6)
    observer = Observer(MODEL, 0.01, lengths=lengths)
    observer.reset(2, 0.1)
    observer.state[:], observer.disturbance[:] = states(rng, 2), 0.3 * rng.standard_normal((2, 6))
    seconds, commands = np.array([0.004, 0.01, 0.01]), rng.uniform(0.05, 0.12, (3, 2, 4))
    found = observer.predicted(seconds, commands)
    for i in range(2):
        x = observer.state[i]
        for dt, command in zip(seconds, commands, strict=True):
            x = stepped(x, command[i], observer.disturbance[i], dt)
        np.testing.assert_allclose(found[i], x, rtol=1e-12, atol=1e-12)


def test_pwm_and_thrust_are_inverse_at_every_voltage_and_end_where_the_battery_does():
    rng = np.random.default_rng(4)
    found = ThrustMap(MODEL)
    volt, motor = rng.uniform(2.9, 4.2, 50), rng.uniform(0.3, 1.0, (50, 4))
    made = numeric.equations(MODEL, 0.01)
    thrust = np.stack(made.command([*motor.T, volt]), axis=1)
    np.testing.assert_allclose(found.ratios(thrust, volt), motor, atol=2e-4)
    least, most = found.limits(np.array([3.0, 3.3, 4.0]))
    np.testing.assert_allclose(most[:, 0], [made.command([1.0] * 4 + [v])[0] for v in (3.0, 3.3, 4.0)], rtol=1e-4)
    assert np.all(least >= 0.0)
    assert np.all(np.diff(most[:, 0]) > 0.0)


def test_a_model_driven_by_rotor_speed_or_without_yaw_is_refused_in_one_line():
    with pytest.raises(InputError, match="motors cannot turn it"):
        prediction_model.Equations4(MODEL.without("yaw_torque"))
    with pytest.raises(InputError, match="PWM"):
        ThrustMap(Model(replace(MODEL.vehicle, input="rpm"), {"thrust_rpm": {"k_f": 1e-8}}))


def test_without_a_compiler_the_same_numbers_come_from_casadi(monkeypatch):
    rng = np.random.default_rng(5)
    x, u = states(rng, 1)[0], rng.uniform(0.05, 0.12, 4)
    monkeypatch.setenv("NANOBENCH_CC", "")
    plain = casadi_code.Call(prediction_model.step_function(MODEL))
    assert not plain.is_c
    for array, value in zip(plain.given, (x, u, 0.0, 0.025), strict=True):
        array[:] = value
    np.testing.assert_allclose(plain()[0][0], stepped(x, u), rtol=1e-12, atol=1e-14)


def test_a_compiler_that_fails_is_done_without(monkeypatch, tmp_path):
    broken = tmp_path / "cc"
    broken.write_text("#!/bin/sh\nexit 1\n")
    broken.chmod(0o755)
    monkeypatch.setenv("NANOBENCH_CC", str(broken))
    monkeypatch.setenv("NANOBENCH_CACHE", str(tmp_path))
    assert not casadi_code.Call(prediction_model.step_function(MODEL)).is_c


def test_a_missing_package_is_one_line_that_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "casadi", None)
    with pytest.raises(MissingExtraError, match=re.escape(f"casadi is not installed; {how_to_install('mpc')}")):
        casadi_code.import_casadi()


@pytest.mark.parametrize("delay_s", [0.0, 0.004, 0.01, 0.03, 0.034])
def test_commands_act_as_late_as_they_should(delay_s):
    """Against a timetable of 1 ms cells."""
    period, steps = 0.01, 12
    way = UnderWay(1, period, delay_s, np.full(4, -1.0))
    cells = np.full(200, -1.0)
    for k in range(steps):
        begin = round(1000 * (k * period + delay_s))
        seen = np.repeat(way.before[:, 0, 0], np.round(1000 * way.before_s).astype(int))
        np.testing.assert_array_equal(seen, cells[10 * k:begin])
        cells[begin:begin + 10] = k
        way.give(np.full((1, 4), float(k)))
        acting = np.repeat(way.acting[:, 0, 0], np.round(1000 * way.acting_s).astype(int))
        np.testing.assert_array_equal(acting, cells[10 * k:10 * k + 10])
