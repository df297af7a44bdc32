"""Set-points as full states and velocities, flown by the simulated vehicle; landings that bounce are no crashes."""

import struct

import numpy as np
import pytest

from controllers.plants.served_vehicle import served
from nanobench_tools.cli.flights.flight_controllers import pilot_for
from nanobench_tools.radio.crtp import Packet
from nanobench_tools.radio.fly.flight_plan import chosen_path
from nanobench_tools.radio.fly.safety import Limits
from nanobench_tools.radio.fly.session import Request, fly_session
from nanobench_tools.radio.fly.setpoint_packets import decoded
from nanobench_tools.radio.fly.virtual import VirtualWorld
from nanobench_tools.radio.simulated.channel import RadioOptions
from nanobench_tools.radio.simulated.motion_capture import MocapOptions
from nanobench_tools.radio.simulated.onboard_services import Build, Onboard
from nanobench_tools.radio.simulated.supervisor import State

RADIO, ROOM = RadioOptions(latency_s=0.010, loss=0.02), MocapOptions(noise_m=1.2e-5, noise_rad=6e-4)


class Watched(VirtualWorld):
    """Keeps what was sent, where the vehicle truly was and its supervisor's states, by time."""

    def __init__(self) -> None:
        super().__init__(served(battery_V=4.1), RADIO, ROOM)
        self.sent: list[dict] = []
        self.true: list[np.ndarray] = []
        self.states: set[State] = set()

    def post(self, datagram: bytes) -> None:
        if datagram[0] & 0xF3 == 0x70:
            self.sent.append(decoded(datagram[1:]))
        super().post(datagram)

    def _step(self, time_s: float) -> None:
        super()._step(time_s)
        onboard = self.simulation.onboard
        self.states.add(onboard.supervisor.state)
        if self._steps % 10 == 0:
            self.true.append(np.array([time_s, *onboard.vehicle.true_pose()[0]]))


@pytest.mark.slow
@pytest.mark.parametrize(("controller", "kind", "most_m"), [
    ("onboard_mellinger", "full-state", 0.03), ("onboard_pid", "velocity", 0.35)])
def test_a_path_is_flown_by_set_points_of_its_kind(controller: str, kind: str, most_m: float) -> None:
    """How far off the circle it is, whatever the lag. Velocities alone hold no place: what the fade-in has lost stays
    lost."""
    world, path = Watched(), chosen_path("circle", 0.5, None, 4.0)
    with world.served() as uri:
        outcome = fly_session(Request(path, pilot_for(controller, kind, None), Limits(), uri, world, (),
                                      clock=world)).outcome
    assert outcome.stop is None
    assert State.CRASHED not in world.states
    assert world.simulation.onboard.vehicle.true_pose()[0][2] < 0.01
    streamed = [s for s in world.sent if s["kind"] != "stop"]
    assert {s["kind"] for s in streamed} == {kind}
    begin, end = (dict(outcome.phases)[name] for name in ("path", "fade-out"))
    true = np.array([row for row in world.true if begin < row[0] < end])[:, 1:]
    assert np.abs(np.linalg.norm(true[:, :2], axis=1) - 1.0).max() < most_m
    assert np.linalg.norm(np.diff(true[:, :2], axis=0), axis=1).sum() == pytest.approx(0.5 * (end - begin), rel=0.2)


@pytest.mark.parametrize(("height_m", "sideways_m_s"), [(0.2, 0.0), (0.3, 0.5), (0.6, 0.0)])
def test_a_vehicle_that_bounces_on_its_legs_has_not_crashed(height_m: float, sideways_m_s: float) -> None:
    """Motors off in the air, in the state of flight: it falls, bounces, and stands."""
    vehicle = served(seed=3)
    onboard, states, bounced = Onboard(vehicle, Build(positioning=True)), set(), []
    onboard.advance(2000)

    def send(data: bytes, seconds: float) -> None:
        for _ in range(round(seconds / 0.02)):
            onboard.receive(Packet(7, 0, data))
            onboard.advance(onboard.tick_ms + 20)
            states.add(onboard.supervisor.state)
            bounced.append(vehicle.true_pose()[1][2])

    send(struct.pack("<B4f", 7, 0.0, 0.0, height_m, 0.0), 4.0)
    send(struct.pack("<B4f", 8, sideways_m_s, 0.0, 0.0, 0.0), 0.8)
    bounced.clear()
    send(bytes([0]), 1.9)
    assert min(bounced) < -1.0
    assert max(bounced) > 0.1
    assert State.CRASHED not in states
    assert vehicle.true_pose()[0][2] == pytest.approx(0.0, abs=0.005)
