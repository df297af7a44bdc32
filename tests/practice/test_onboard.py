"""The onboard controllers against the numbers the firmware itself computed, and against hand-worked signs."""

import io
import lzma

import numpy as np
import pyarrow.csv
import pytest

from nanobench_tools import so3
from nanobench_tools.errors import UsageError
from nanobench_tools.firmware.motor_output import BUILD, compensated
from nanobench_tools.firmware.thrust_curve import THRUST_MAX_N, thrust_of_voltage, voltage_of_thrust
from nanobench_tools.frames import MOTOR_SIGNS
from nanobench_tools.methods import Controller, Reference, VehicleState
from nanobench_tools.practice.onboard_crowd import Mellinger, OnboardFleet, PidCascade
from nanobench_tools.practice.timeline import planner


def read(path):
    data = path.read_bytes()
    table = pyarrow.csv.read_csv(io.BytesIO(lzma.decompress(data) if path.suffix == ".xz" else data))
    return {name: table[name].to_numpy() for name in table.column_names}


@pytest.mark.real
def test_planner_gives_the_firmwares_path(real_data):
    table = read(real_data / "firmware_reference" / "planner_samples.csv.xz")
    rows = table["case"] == "takeoff_a"  # from 0.03 m to 1 m in 2 s
    way, speed, acceleration, jerk = planner(table["t_s"][rows] / 2.0)
    np.testing.assert_allclose(0.03 + 0.97 * way, table["z"][rows], atol=5e-4)
    np.testing.assert_allclose(0.97 * speed / 2.0, table["vz"][rows], atol=5e-4)
    np.testing.assert_allclose(0.97 * acceleration / 4.0, table["az"][rows], atol=5e-4)
    np.testing.assert_allclose(0.97 * jerk / 8.0, table["jz"][rows], atol=5e-4)


def test_thrust_curve_is_the_inverse_of_itself_and_hits_published_points():
    volt = np.linspace(0.8, 4.2, 50)
    np.testing.assert_allclose(voltage_of_thrust(thrust_of_voltage(volt)), volt, atol=1e-9)
    assert voltage_of_thrust(THRUST_MAX_N) == pytest.approx(3.0799, abs=1e-4)
    assert thrust_of_voltage(4.0) == pytest.approx(0.2412, abs=1e-4)
    assert thrust_of_voltage(0.0) == 0.0
    assert compensated(np.float32([6900.0, 32767.0]), np.float32([3.7, 1.9]), *BUILD[0]).tolist() == [0.0, 0.0]


def hovering(n=1, **changes):
    """A state at rest at the origin, level, and a reference at the same place."""
    state = {"position_m": np.zeros((n, 3)), "velocity_m_s": np.zeros((n, 3)),
             "quaternion": np.tile([0.0, 0.0, 0.0, 1.0], (n, 1)), "rate_rad_s": np.zeros((n, 3)),
             "battery_V": np.full(n, 3.6)}
    state.update({k: v for k, v in changes.items() if k in state})
    target = changes.get("target", np.zeros((n, 3)))
    return VehicleState(**state), Reference(target, np.zeros(n), np.zeros((n, 3)), np.zeros((n, 3)))


@pytest.mark.parametrize("kind", [PidCascade, Mellinger])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_turn_about_an_axis_is_answered_by_the_opposite_moment(kind, axis):
    controller = kind()
    assert isinstance(controller, Controller)
    controller.reset(2)
    turn = np.zeros((2, 3))
    turn[1, axis] = 0.5
    state, reference = hovering(2, quaternion=so3.exp(turn), target=np.tile([0.0, 0.0, 0.4], (2, 1)))
    for step in range(12):
        ratio = controller.command(0.002 * step, state, reference)
    moment = (ratio[1] - ratio[0]) @ MOTOR_SIGNS
    assert moment[axis] < -1e-3
    assert np.all(np.abs(np.delete(moment, axis)) < 0.3 * abs(moment[axis]))


@pytest.mark.parametrize("kind", [PidCascade, Mellinger])
def test_a_target_ahead_pitches_the_nose_down_and_one_to_the_left_rolls_left(kind):
    controller = kind()
    controller.reset(2)
    state, reference = hovering(2, target=np.array([[1.0, 0.0, 0.4], [0.0, 1.0, 0.4]]))
    for step in range(12):
        ratio = controller.command(0.002 * step, state, reference)
    ahead, left = ratio @ MOTOR_SIGNS
    assert ahead[1] > 1e-3  # positive pitch is nose down in this convention
    assert left[0] < -1e-3


def test_the_fleet_flies_each_vehicle_as_if_it_were_alone():
    rng = np.random.default_rng(4)
    names = ["mellinger", "pid", "pid", "mellinger"]
    fleet, singles = OnboardFleet(names), [OnboardFleet([name]) for name in names]
    fleet.reset(4)
    for single in singles:
        single.reset(1)
    for step in range(20):
        state, reference = hovering(4, position_m=0.1 * rng.standard_normal((4, 3)),
                                    rate_rad_s=rng.standard_normal((4, 3)))
        together = fleet.command(0.002 * step, state, reference)
        for i, single in enumerate(singles):
            one = [type(x)(*(v if v is None else v[[i]] for v in vars(x).values())) for x in (state, reference)]
            np.testing.assert_array_equal(single.command(0.002 * step, *one)[0], together[i])
    assert fleet.log.written.tolist() == [False, True, True, False]
    with pytest.raises(UsageError, match="known: pid, mellinger"):
        OnboardFleet(["pdi"])
