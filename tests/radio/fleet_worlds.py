"""Fleets of simulated vehicles on one clock, with faults, for tests."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from fleet_plans import TWO, fleet

from controllers.plants.served_vehicle import served
from nanobench_tools.cli.flights.flight_controllers import pilot_for
from nanobench_tools.radio.fleet.fleet_plan import read_fleet
from nanobench_tools.radio.fleet.fleet_session import Fleet, Flown
from nanobench_tools.radio.fleet.virtual_fleet import FleetWorld, VirtualFleet, on_clock
from nanobench_tools.radio.fly.safety import Limits
from nanobench_tools.radio.fly.session import Request
from nanobench_tools.radio.simulated.channel import RadioOptions
from nanobench_tools.radio.simulated.motion_capture import MocapOptions

ROOM = MocapOptions(noise_m=1.2e-5, noise_rad=6e-4)


class Watched:
    """A simulated fleet of the plan in ``text``, and what it did: ``top_m``, fastest sinking and the smallest distance.
    ``fault`` is called every millisecond with this and the seconds since all were above half a metre."""

    def __init__(self, folder: Path, text: str = TWO, fault: Callable[[Watched, float], None] = lambda w, s: None,
                 record: bool = False, places: dict[int, tuple[float, float]] | None = None) -> None:
        self.plan = read_fleet(fleet(folder, text=text))
        spots = {i: v.place_m for i, v in enumerate(self.plan.vehicles)} | (places or {})
        self.fleet = VirtualFleet(len(self.plan.vehicles), lambda i, uri, start_s: FleetWorld(
            served(start_m=(*spots[i], 0.0), seed=i), RadioOptions(latency_s=0.010, seed=i), ROOM, uri, start_s))
        self.vehicles = [world.simulation.onboard.vehicle for world in self.fleet.worlds]
        self.fleet.after_step = self._look
        self._fault, self._high_s = fault, np.inf
        self.top_m, self.sank_m_s = np.zeros(len(self.vehicles)), np.zeros(len(self.vehicles))
        self.nearest_m = np.inf
        requests = [Request(v.path, pilot_for(v.controller, v.setpoints, v.simulator), Limits(), v.uri,
                            self.fleet.worlds[0], (), record_to=folder / "flights" if record else None)
                    for v in self.plan.vehicles]
        self.session = Fleet(self.plan.vehicles, on_clock(requests, self.fleet), self.plan.separation,
                             turn=self.fleet.turn)

    def _look(self, time_s: float) -> None:
        poses = [vehicle.true_pose() for vehicle in self.vehicles]
        places = np.array([pose[0] for pose in poses])
        self.top_m = np.maximum(self.top_m, places[:, 2])
        self.sank_m_s = np.maximum(self.sank_m_s, [-pose[1][2] for pose in poses])
        self.nearest_m = min(self.nearest_m, float(np.linalg.norm(places[0] - places[1])))
        if (places[:, 2] > 0.5).all():
            self._high_s = min(self._high_s, time_s)
        if time_s >= self._high_s:
            self._fault(self, time_s - self._high_s)

    def fly(self) -> list[Flown]:
        """All flights, to their end."""
        with self.fleet.served():
            return self.session.fly()

    @property
    def heights_m(self) -> list[float]:
        """Where the vehicles are now."""
        return [float(vehicle.true_pose()[0][2]) for vehicle in self.vehicles]
