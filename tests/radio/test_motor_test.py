"""Motors before take-off: the firmware's test in the simulated vehicle, and what the host makes of its results."""

import json

import numpy as np
import pytest
from still_vehicle import StillVehicle

from nanobench_tools.errors import InputError
from nanobench_tools.radio.fly.motor_test import MotorTest, check_motors, failures
from nanobench_tools.radio.fly.virtual import VirtualWorld
from nanobench_tools.radio.simulated.supervisor import State
from nanobench_tools.radio.vehicle_link import open_link


class ShakingVehicle(StillVehicle):
    """Its accelerometer shakes with every motor that turns, by ``shake_g`` (4,) at full command; the cell sags."""

    def __init__(self, shake_g=(0.1, 0.1, 0.1, 0.1), sag_V: float = 0.2) -> None:
        self.shake_g, self.sag_V, self.rng = np.array(shake_g), sag_V, np.random.default_rng(0)
        self.turned = np.zeros(4)
        super().__init__()

    def advance(self, milliseconds: int) -> None:
        super().advance(milliseconds)
        loop = self.stabilizer.loop[0]
        ratio = loop["direct"] / 65535.0 if loop["override"] else np.zeros(4)
        self.turned += milliseconds * (ratio > 0.0)
        loop["acc_g"] = [0.0, 0.0, 1.0] + self.rng.normal(size=3) * (0.002 + ratio @ self.shake_g)
        loop["vbat_V"] = 4.1 - self.sag_V * ratio.sum()
        if ratio.any():
            loop["motor_on_step"] = loop["step"]


def checked(vehicle: ShakingVehicle, store=None, before=lambda link: None):
    """Lines of a check through cflib, and the world."""
    world, said = VirtualWorld(vehicle), []
    with world.served() as uri, open_link(uri, world) as link:
        before(link)
        check_motors(link, world, said.append, store)
    return said, world


def test_good_motors_pass_turn_for_a_moment_and_leave_the_vehicle_as_it_was(tmp_path):
    vehicle, store = ShakingVehicle(), tmp_path / "radio" / "tests.json"
    for k in range(4):
        said, world = checked(vehicle, store)
        assert ("like each other" in said[-1]) == (k < 3)
    assert "like 3 earlier tests" in said[-1]
    np.testing.assert_array_equal(vehicle.turned, 4 * (50 + 50))  # and once more for the battery
    assert vehicle.stabilizer.loop["override"][0] == 0
    assert world.simulation.onboard.supervisor.state in (State.CHECKS_PASSED, State.READY)
    kept, = json.loads(store.read_text()).values()
    assert len(kept) == 4
    assert 0.5 < np.median(kept) < 1.5  # 50 of 100 samples at .1 g, two axes


@pytest.mark.parametrize(("vehicle", "words"), [
    (ShakingVehicle((0.1, 0.0, 0.1, 0.1)), "M2 shakes 0.00 times as much as the others: does it turn, is its"),
    (ShakingVehicle((0.1, 0.1, 0.1, 0.4)), "M4 shakes 1.* times as much as the others: a bent, cut or loose propeller"),
    (ShakingVehicle(sag_V=1.0), "the battery sags by 2.* V under load")])
def test_a_motor_that_is_not_like_the_others_is_refused(vehicle, words, tmp_path):
    store = tmp_path / "tests.json"
    with pytest.raises(InputError, match=words):
        checked(vehicle, store)
    assert not store.exists()
    assert vehicle.stabilizer.loop["override"][0] == 0


def test_the_vehicles_own_thresholds_count():
    def threshold(link):
        link.set_parameter("health.propTestThreshold", 2.0)

    with pytest.raises(InputError, match="M3 fails the vehicle's own propeller test"):
        checked(ShakingVehicle((0.1, 0.1, 0.2, 0.1)), before=threshold)
    checked(ShakingVehicle(), before=threshold)


def test_what_is_usual_for_this_vehicle_counts_more_than_the_other_motors():
    usual = [(1.0, 1.0, 1.0, 4.0)] * 3
    good, bad = ((1.2, 0.9, 1.0, 4.5), (1.0, 1.0, 3.5, 4.0))
    assert not failures(MotorTest(good, 1 << 7, 0.2, True), usual)
    assert failures(MotorTest(bad, 1 << 7, 0.2, True), usual) == [
        "M3 shakes 3.5 times as much as usual: a bent, cut or loose propeller?"]
    assert not failures(MotorTest(bad, 1 << 7, 0.2, True), usual[:2])
    assert failures(MotorTest((np.nan, 1.0, 1.0, 1.0), 1 << 7, 0.2, True)) == ["M1 was not measured"]


def test_a_vehicle_without_the_test_is_refused():
    from nanobench_tools.radio.simulated.onboard_services import Build, Onboard

    world = VirtualWorld(StillVehicle())
    world.simulation.onboard = Onboard(world.simulation.onboard.vehicle, Build(without=("health",)))
    with world.served() as uri, open_link(uri, world) as link, pytest.raises(InputError, match="fly without --check"):
        check_motors(link, world, lambda text: None)
