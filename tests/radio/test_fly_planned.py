"""What a predictive controller sends, put through the firmware's own loops and mixer: the motors do what it planned."""

import numpy as np
import pytest

from nanobench_tools import so3
from nanobench_tools.firmware.onboard import STEPS, PidCascade, estimates
from nanobench_tools.firmware.records import SETPOINT, VELOCITY
from nanobench_tools.firmware.thrust_curve import THRUST_MAX_N, thrust_of_voltage
from nanobench_tools.methods import Reference, VehicleState
from nanobench_tools.radio.fly import setpoint_packets as sp
from nanobench_tools.radio.fly.heading import yaw_rate
from nanobench_tools.radio.fly.predictive import MOST_RATE_RAD_S, TO_ROLL_PITCH, PlannedPilot

BATTERY_V = 3.6
RATE = np.array([0.3, -0.2, 0.0])
HOVER = Reference(np.zeros((1, 3)), np.zeros(1), np.zeros((1, 3)), np.zeros((1, 3)))


class Following(PidCascade):
    """The firmware's cascade, told records instead of references."""

    def follow(self, record, state, reference):
        """record (n,) SETPOINT -> PWM ratios (n, 4)."""
        state, _ = self.guard.admit(state, reference)
        estimates(state, self._estimate[0])
        self._setpoint[0] = record
        self._step += STEPS
        type(self)._run(np.array([self._step]), self.parameters, self.state, self._setpoint, self._estimate,
                        self._control, self._no_trace)
        return self.guard.release(self._drive(self._control[0], state.battery_V))


class Planned:
    """Commands ``ratios`` (4,) and foresees the rate ``RATE``."""

    name = "planned"

    def __init__(self, ratios) -> None:
        self.ratios = np.asarray(ratios, float)

    def reset(self, n: int) -> None:
        pass

    def command(self, time_s, state, reference):
        return self.ratios[None]

    def foreseen(self, seconds: float):
        return np.concatenate([np.zeros(10), RATE, np.zeros(4)])[None]


def state(yaw: float = 0.0) -> VehicleState:
    return VehicleState(np.zeros((1, 3)), np.zeros((1, 3)), so3.from_euler_zyx(0.0, 0.0, yaw)[None],
                        RATE[None], np.array([BATTERY_V]))


def counts(ratios: np.ndarray) -> np.ndarray:
    return thrust_of_voltage(ratios * BATTERY_V) / THRUST_MAX_N * 65535.0


def test_the_firmwares_loops_make_of_it_what_was_planned_at_once_and_after_a_second():
    planned = Planned([0.84, 0.80, 0.86, 0.88])
    pilot = PlannedPilot(lambda delay_s: planned)
    pilot.reset()
    loops = Following()
    loops.reset(1)
    asked = TO_ROLL_PITCH @ counts(planned.ratios)
    for tick in range(100):
        told = sp.decoded(pilot.packet(0.01 * tick, state(), HOVER))
        record = np.zeros(1, SETPOINT)
        record["mode_roll"] = record["mode_pitch"] = record["mode_yaw"] = VELOCITY
        record["rate_deg_s"] = np.degrees(told["rate_rad_s"]) * [1.0, -1.0, 1.0]
        record["thrust"] = told["thrust_counts"]
        for _ in range(5):
            driven = loops.follow(record, state(), HOVER)[0]
        if tick in (60, 99):  # the firmware knows the battery by then
            found = counts(driven)
            np.testing.assert_allclose(TO_ROLL_PITCH @ found, asked, rtol=0.08)
            assert found.mean() == pytest.approx(counts(planned.ratios).mean(), rel=0.01)
    assert np.abs(told["rate_rad_s"][:2] - RATE[:2]).max() < 0.35 * np.abs(asked).max() / np.degrees(250.0)


def test_rates_stay_within_their_bound_and_what_is_cut_off_is_not_held_against_them():
    pilot = PlannedPilot(lambda delay_s: Planned([0.0, 0.0, 1.0, 1.0]))
    pilot.reset()
    told = [sp.decoded(pilot.packet(0.01 * k, state(), HOVER))["rate_rad_s"] for k in range(50)]
    assert np.abs(told).max() <= MOST_RATE_RAD_S + 1e-6
    assert told[0][0] > told[-1][0] > RATE[0]


def test_the_heading_is_led_back_the_shorter_way_and_not_faster_than_it_may():
    asked = Reference(np.zeros((1, 3)), np.array([np.radians(170.0)]), np.zeros((1, 3)), np.zeros((1, 3)),
                      yaw_rate_rad_s=np.array([0.2]))
    assert yaw_rate(state(np.radians(-170.0)), asked) == pytest.approx(0.2 - 1.5 * np.radians(20.0), abs=1e-6)
    assert yaw_rate(state(np.radians(-20.0)), asked) == pytest.approx(-4.0)
    assert yaw_rate(state(), HOVER) == pytest.approx(0.0, abs=1e-9)
