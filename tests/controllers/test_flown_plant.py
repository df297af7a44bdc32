"""The plant: hover and free fall by hand, the world turned about z, step size, company, delay, bad input."""

import numpy as np
import pytest

from controllers.mpc.prediction_model import practice_model
from controllers.plants.closed_loop import fly
from controllers.plants.ensemble import draw, shipped_draws, shipped_simulator
from controllers.plants.kalman_senses import Onboard
from controllers.plants.plant import Cell, Plant, Trace, closed_loop_model, hover_ratio, share_of_firmware
from controllers.plants.senses import Sensing
from nanobench_tools import so3
from nanobench_tools.errors import InputError, UsageError
from nanobench_tools.firmware.onboard import PidCascade
from nanobench_tools.methods import Reference
from nanobench_tools.physics import Model, Vehicle, numeric
from nanobench_tools.physics.simulator import loads

MODEL = loads(shipped_simulator()).without("command_delay")
QUIET = Sensing(noise=0.0, pose_noise_m=0.0)


def start(n, height=1.0, yaw=0.0):
    states = np.zeros((n, 13))
    states[:, 2] = height
    states[:, 6:10] = so3.from_euler_zyx(0.0, 0.0, yaw)
    return states


def plant(n=1, volts=3.6, model=MODEL, states=None, **how):
    trace = Trace(np.full((1, n), volts), 0.01)
    ratio = hover_ratio(model, np.full(n, volts))
    return Plant(model, start(n) if states is None else states, np.repeat(ratio[:, None], 4, axis=1), trace, **how)


def rngs(n):
    return [np.random.default_rng(i) for i in range(n)]


def told(goal, yaw=0.0):
    goal = np.atleast_2d(goal)
    zero = np.zeros_like(goal)
    return lambda tick: Reference(goal, np.full(len(goal), yaw), zero, zero)


def test_it_hovers_where_thrust_carries_the_weight():
    one = plant()
    for _ in range(500):
        one.advance(one.motor.T)
    assert np.abs(one.state[:6, 0] - [0, 0, 1, 0, 0, 0]).max() < 2e-3
    lift = one.state[13:, 0].sum()
    assert lift == pytest.approx(MODEL.vehicle.mass_kg * 9.81, rel=1e-4)


def test_the_share_of_the_firmwares_thrust_is_the_scale_of_its_own_curve():
    bare = practice_model().without("thrust_scale")
    assert share_of_firmware(bare) == pytest.approx(1.0, abs=1e-6)
    assert share_of_firmware(bare.with_term("thrust_scale", s=0.9)) == pytest.approx(0.9, abs=1e-6)


def test_the_shipped_vehicle_is_a_physical_one():
    """Inertia as of a swung Crazyflie of 28 g (Foerster 2015) and in the firmware's Lee controller (32.7 g); motors as
    slow as rotor speed shows in brushed logs; a yaw moment as on stands."""
    inertia = MODEL.values_of("inertia")["inertia_kg_m2"]
    assert 1.4e-5 < min(inertia[:2]) <= max(inertia[:2]) < 2.1e-5 < inertia[2] < 4.0e-5
    assert MODEL.values_of("motor_lag")["tau_down_s"] > MODEL.values_of("motor_lag")["tau_up_s"] > 0.04
    assert 5e-3 < MODEL.values_of("yaw_torque")["k_m"] < 8e-3


def test_it_falls_freely_without_thrust_and_keeps_its_energy():
    bare = MODEL.without("drag_linear", "drag_torque", "angular_damping", "motor_lag")
    one = plant(model=bare)
    one.advance(np.zeros((1, 4)))  # below 0.4 V the curve of the thrust is negative, and is cut at zero nowhere
    thrust = one.state[13:, 0].sum()
    before = one.state[:6, 0].copy()
    for _ in range(100):
        one.advance(np.zeros((1, 4)))
    a = thrust / MODEL.vehicle.mass_kg - 9.81
    t = 100 * one.step_s
    assert one.state[5, 0] == pytest.approx(before[5] + a * t, rel=1e-9)
    assert one.state[2, 0] == pytest.approx(before[2] + before[5] * t + 0.5 * a * t * t, rel=1e-9)


def test_it_is_the_model_stepped_by_its_own_equations():
    one = plant(states=start(1) + 0.01 * np.arange(13))
    x = one.state.T.copy()
    motor = np.array([[0.8, 0.75, 0.78, 0.82]])
    for _ in range(20):
        one.advance(motor)
        x = numeric.step(closed_loop_model(MODEL), x, np.concatenate([motor, [[3.6]]], axis=1), row_hz=500.0)
    assert np.abs(one.state.T - x).max() < 1e-12


def flown(yaw=0.0, n=1, seconds=1.5):
    goal = so3.rotate(so3.from_euler_zyx(0.0, 0.0, np.array(yaw)), np.array([0.6, 0.2, 1.1]))
    some = plant(n, states=start(n, yaw=yaw))
    senses = Onboard(some, QUIET, rngs(n))
    return fly(some, senses, PidCascade(), told(np.tile(goal, (n, 1)), yaw), round(seconds / 0.01))


def test_turning_the_world_turns_the_flight():
    straight, turned = flown(), flown(0.9)
    back = so3.rotate_inverse(so3.from_euler_zyx(0.0, 0.0, np.array(0.9)), turned.position_m[:, 0])
    assert np.abs(straight.position_m[-1, 0] - [0, 0, 1]).max() > 0.1
    assert np.abs(back - straight.position_m[:, 0]).max() < 3e-3  # the firmware counts in float32


def test_a_vehicle_flies_the_same_alone_and_in_a_crowd():
    assert np.array_equal(flown().position_m[:, 0], flown(n=11).position_m[:, 7])


def test_halving_the_step_changes_little():
    ends = []
    for k in (1, 4):
        one = plant(states=start(1), step_s=0.002 / k)
        for i in range(100 * k):
            tilt = 0.01 * np.sin(0.05 * (i // k))
            one.advance(one.motor.T * 0 + np.array([[0.8 - tilt, 0.8, 0.8 + tilt, 0.8]]))
        ends.append(one.state[:13, 0].copy())
    assert np.abs(ends[0] - ends[1]).max() < 1e-6


def test_a_delay_holds_the_command_back():
    late = MODEL.with_term("command_delay", delay_s=0.021)
    plants = [plant(model=m) for m in (MODEL, late)]
    heard = [[], []]
    for i in range(40):
        for one, found in zip(plants, heard, strict=True):
            one.advance(np.full((1, 4), 0.9 if i >= 5 else one.motor[0, 0]))
            found.append(one.state[13, 0])
    first = [int(np.argmax(np.array(h) > h[0] + 1e-6)) for h in heard]
    assert first == [5, 15]  # 21 ms later: from the eleventh step on half of it, as between 20 and 22 ms


def test_the_battery_sags_and_the_ground_holds():
    cell = Cell(np.array([4.0]), np.array([0.12]), np.array([0.47]))
    assert cell.volts(0.0, np.full((4, 1), 0.8))[0] == pytest.approx(4.0 / (1.0 + 0.12 * 0.47 * 4 * 0.64))
    one = plant(states=start(1, 0.2), ground_z=0.0)
    for _ in range(1500):
        one.advance(np.full((1, 4), 0.3))
    assert -0.002 < one.state[2, 0] < 0.002
    assert np.abs(one.state[3:6, 0]).max() < 0.02


def test_the_filter_takes_the_pull_of_the_air_for_tilt():
    one = plant()
    senses = Onboard(one, QUIET, rngs(1))
    pull, t = -0.4, 0.0
    for _ in range(1000):  # level, slowed down by something that is not thrust
        t += one.step_s
        one.before_m_s = one.state[3:6].copy()
        one.state[:13, 0] = [0.5 * pull * t * t, 0, 1.0, pull * t, 0, 0, 0, 0, 0, 1, 0, 0, 0]
        senses.step()
    roll, pitch, yaw = np.degrees(so3.euler_zyx(senses.read(0)[2])[0])
    believed = np.degrees(pull / 9.81)
    assert max(abs(roll), abs(yaw)) < 0.05
    assert 0.5 < pitch / believed < 1.05  # part of it, as the poses' attitude says level


def cruising(shut=None, n=1, delay_s=0.020):
    """(velocity over the true one (n,), estimated place less the true one (m, n)), filters carried along x at 1 m/s."""
    crowd = plant(n, states=start(n))
    senses = Onboard(crowd, Sensing(delay_s, 0.0, pose_noise_m=0.0, shut=shut), rngs(n),
                     belief=np.tile([0, 0, 1.0, 1.0, 0, 0, 0, 0, 0, 1, 0, 0, 0], (n, 1)))
    seen = []
    for k in range(3000):
        crowd.time_s += crowd.step_s
        crowd.before_m_s = np.tile([[1.0], [0.0], [0.0]], (1, n))
        crowd.state[:13] = np.array([crowd.time_s, 0, 1.0, 1.0, 0, 0, 0, 0, 0, 1, 0, 0, 0])[:, None]
        senses.step()
        if k % 5 == 4:
            place, speed, _ = senses.read(k // 5)
            seen.append(np.stack([place[:, 0] - crowd.time_s, speed[:, 0]]))
    seen = np.array(seen)[200:]
    return seen[:, 1].mean(axis=0), seen[:, 0]


def test_poses_that_wait_for_the_radio_come_all_at_once_and_make_the_vehicle_believe_it_is_slower():
    """Without gaps the filter knows the speed to 2 % (it drops turns below 1e-4 rad); with them it loses some."""
    ticks = np.arange(600)
    gaps = np.stack([np.zeros(600, bool), ticks % 100 < 6, ticks % 100 < 12], axis=1)
    speed, off = cruising(gaps, 3)
    assert speed[0] == pytest.approx(1.0, abs=0.025)
    assert 0.9 < speed[1] < 0.985
    assert speed[2] < speed[1] - 0.02
    assert np.abs(off[ticks[200:] % 100 == 99] - off[-1, 0]).max() < 5e-3  # the place is back before the next gap
    alone, _ = cruising(gaps[:, 1:2])
    assert alone[0] == speed[1]


def test_the_estimated_place_is_as_late_as_it_is_said_to_be_within_what_the_air_does():
    _, early = cruising(delay_s=0.010)
    _, late = cruising(delay_s=0.040)
    assert np.median(early) - np.median(late) == pytest.approx(0.030, abs=2.1e-3)  # m at 1 m/s, in steps of 2 ms


def test_an_ensemble_is_the_same_in_any_company_and_its_first_plant_is_the_median_one():
    few, many = draw(shipped_simulator(), 2, 3), draw(shipped_simulator(), 9, 3)
    assert np.array_equal(few.parameters, many.parameters[:2])
    assert np.allclose(many.parameters[0], many.model.values)
    mass = many.parameters[:, many.model.index("mass.m")] / MODEL.vehicle.mass_kg
    assert (np.abs(mass - 1.0) <= 0.1).all()
    assert mass.std() > 0.02
    assert ((many.delay_s >= 0.010) & (many.delay_s <= 0.040)).all()
    assert ((many.hover_V >= 3.2) & (many.hover_V <= 3.9)).all()
    names, rows = shipped_draws()
    assert names == loads(shipped_simulator()).names
    assert len(rows) >= 50
    one = few.plant(np.array([[0, 0, 1.0]] * 2))
    assert np.allclose(one.battery_V, few.hover_V)


class Constant:
    name, information, period_s = "constant", "as flown", 0.002

    def __init__(self, value, period_s=0.002):
        self.value, self.period_s = value, period_s

    def reset(self, n):
        self.n = n

    def command(self, time_s, state, reference):
        if isinstance(self.value, Exception):
            raise self.value
        return self.value


@pytest.mark.parametrize(("controller", "error", "words"), [
    (Constant(np.zeros((1, 4)), 0.003), UsageError, "multiple of 0.002"),
    (Constant(np.zeros((2, 4))), UsageError, r"must be \(1, 4\)"),
    (Constant(np.full((1, 4), np.nan)), InputError, "finite PWM ratios"),
    (Constant(np.full((1, 4), 1.5)), InputError, "finite PWM ratios"),
    (Constant(ValueError("oh")), UsageError, "raised ValueError at 0.000 s: oh")])
def test_bad_controllers_are_named(controller, error, words):
    one = plant()
    with pytest.raises(error, match=words):
        fly(one, Onboard(one, QUIET, rngs(1)), controller, told([0, 0, 1.0]), 3)


def test_bad_plants_are_refused():
    with pytest.raises(InputError, match=r"give \(2, 13\) and \(2, 4\)"):
        Plant(MODEL, start(2), np.zeros((1, 4)), Trace(np.full((1, 2), 3.6), 0.01))
    with pytest.raises(InputError, match="rpm"):
        closed_loop_model(Model(Vehicle(input="rpm"), {"thrust_rpm": {"k_f": 2e-8}}))
