"""The landing that ``fly`` commands, flown by the served vehicle's own planner: no bounce, no fall at its end."""

import struct

import numpy as np
import pytest

from controllers.plants.served_vehicle import served
from nanobench_tools.radio.crtp import Packet, Port
from nanobench_tools.radio.fly.landing_profile import goal_m, lasts_s
from nanobench_tools.radio.simulated.high_level import LAND_2, TAKEOFF_2
from nanobench_tools.radio.simulated.onboard_services import Build, Onboard
from nanobench_tools.radio.simulated.supervisor import State

HEIGHT_M = 1.0


def command(what: int, height_m: float, seconds: float) -> Packet:
    return Packet(Port.HIGH_LEVEL, 0, struct.pack("<BBff?f", what, 0, height_m, 0.0, True, seconds))


@pytest.mark.parametrize("battery_V", [3.85, 4.15])
def test_a_landing_ends_on_the_ground_before_the_motors_stop(battery_V: float) -> None:
    onboard = Onboard(served(battery_V=battery_V), Build(positioning=True))
    onboard.advance(3000)
    onboard.receive(command(TAKEOFF_2, HEIGHT_M, 2.0))
    onboard.advance(onboard.tick_ms + 6000)
    onboard.receive(command(LAND_2, goal_m(0.0), lasts_s(0.0, HEIGHT_M)))
    seen = []
    for _ in range(3000):
        onboard.advance(onboard.tick_ms + 2)
        place, velocity, _ = onboard.vehicle.true_pose()
        loop = onboard.vehicle.stabilizer.loop
        seen.append((place[2], velocity[2], loop["acc_g"][0][2], loop["motor"].max()))
    height, velocity, acceleration, motor = np.array(seen).T
    touch, off = int(np.argmax(height < 0.001)), int(np.argmax(motor == 0.0))
    assert height[off] < 0.02
    assert velocity[touch - 1] > -0.45
    assert height[touch:].max() < 0.04
    assert acceleration[touch:].min() > -0.2  # below, the supervisor may take the vehicle for one on its back
    assert onboard.supervisor.state in (State.FLYING, State.LANDED)
