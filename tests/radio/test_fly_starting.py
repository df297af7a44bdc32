"""A vehicle that is still starting is waited for, with one line and a limit; on the simulated vehicle's own clock."""

import numpy as np
import pytest
from still_vehicle import StillVehicle
from toy_vehicle import LEVEL, Toy

from nanobench_tools.errors import InputError
from nanobench_tools.radio.blocks import Block, check_half_precision
from nanobench_tools.radio.fly import checklist
from nanobench_tools.radio.fly.prepare import Preparation
from nanobench_tools.radio.fly.safety import Limits
from nanobench_tools.radio.fly.virtual import VirtualWorld
from nanobench_tools.radio.mocap.pose_datagram import Pose
from nanobench_tools.radio.vehicle_link import NotStartedError, open_link

HALVES = [Block("a", 100, ("acc.x",), ("FP16",))]


class StartingWorld(VirtualWorld):
    """Answers from ``after_s`` on."""

    def __init__(self, after_s: float) -> None:
        super().__init__(StillVehicle())
        self.up_s, self.down = self.now() + after_s, True

    def sleep_until(self, time_s: float) -> None:
        while self._time_s < time_s - 1e-6:
            self.down = self._time_s < self.up_s
            super().sleep_until(min(self._time_s + 0.01, time_s))


def test_a_vehicle_that_answers_later_is_waited_for_with_one_line():
    world, said = StartingWorld(8.0), []
    with world.served() as uri, open_link(uri, world, patience_s=60.0, say=said.append) as link:
        assert "supervisor.info" in link.log_types
        assert 0.0 < world.now() - world.up_s < 6.0  # an attempt takes 5 s
        with pytest.raises(InputError, match=r"acc\.x as FP16 from firmware 2025\.12\.1; before 2026\.08 it halves"):
            link.start_blocks(HALVES)
        assert len(link.start_blocks([Block("b", 100, ("acc.x",), ("",))])) == 1
    assert len(said) == 1
    assert "it may still be starting: tried for another 5" in said[0]


def test_a_vehicle_that_never_answers_is_given_up_at_the_limit():
    world = StartingWorld(1e9)
    begun = world.now()
    with world.served() as uri, pytest.raises(NotStartedError, match="no answer in 5 s"), \
            open_link(uri, world, patience_s=13.0):
        pass
    assert 13.0 < world.now() - begun < 20.0


@pytest.mark.parametrize(("firmware", "refused"), [
    ("2025.12.1", True), ("2026.04", True), ("", True), ("2026.08", False), ("2026.08.1 +3", False), ("2027.1", False)])
def test_half_precision_is_refused_from_firmware_that_halves_values(firmware, refused):
    if refused:
        with pytest.raises(InputError, match=r"acc\.x as FP16"):
            check_half_precision(HALVES, firmware, "radio://0")
    else:
        check_half_precision(HALVES, firmware, "radio://0")
    check_half_precision([Block("a", 100, ("acc.x",), ("float",))], firmware, "radio://0")


def preparation(toy: Toy, said: list[str]) -> Preparation:
    return Preparation(toy, toy.track, toy, Limits(), "toy", lambda on: None, said.append)


def test_a_supervisor_that_does_not_allow_arming_yet_is_waited_for():
    toy, said = Toy(), []
    toy.values["supervisor.info"] = 0
    toy.at.append((toy.time_s + 6.0, lambda: toy.values.update({"supervisor.info": 0b0001})))
    preparation(toy, said)._wait_for_supervisor()
    assert 6.0 <= toy.time_s - 100.0 < 6.1
    assert said == ["the vehicle does not allow arming yet: waits up to 15 s, Ctrl-C ends it"]
    toy.values["supervisor.info"] = 0
    with pytest.raises(InputError, match="does not allow arming"):
        preparation(toy, said)._wait_for_supervisor()
    begun = toy.time_s
    toy.values["supervisor.info"] = 1 << 6
    with pytest.raises(InputError, match="locked"):
        preparation(toy, said)._wait_for_supervisor()
    assert toy.time_s == begun  # it will not come to anything


@pytest.mark.parametrize(("after", "ends_well"), [(1, True), (2, True), (3, False)])
def test_a_filter_that_has_not_converged_is_reset_again(after, ends_well):
    """The estimate is a metre away until the filter has been reset so often."""
    toy, said = Toy(), []
    resets = []

    def set_parameter(name: str, value: float) -> None:
        if name == "kalman.resetEstimation":
            resets.append(toy.time_s)
            toy.astray_m = np.zeros(3) if len(resets) > after else np.array([1.0, 0.0, 0.0])

    toy.set_parameter = set_parameter
    toy.values |= {"stateEstimate.qx": 0.0, "stateEstimate.qy": 0.0, "stateEstimate.qz": 0.0, "stateEstimate.qw": 1.0}
    toy.sleep_until(toy.time_s + 0.1)
    pose = Pose(toy.time_s, toy.place.copy(), LEVEL)
    if ends_well:
        preparation(toy, said)._estimate(pose, 0.0)
        assert len(resets) == after + 1
    else:
        with pytest.raises(checklist.NotConvergedError, match="the vehicle's estimate stays 100 cm"):
            preparation(toy, said)._estimate(pose, 0.0)
        assert len(resets) == checklist.RESETS
    assert sum("the vehicle's filter is reset again" in line for line in said) == len(resets) - 1
