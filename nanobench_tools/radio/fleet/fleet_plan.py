"""Plan of a fleet: two to eight vehicles with address, place, path, controller and delay."""

from collections import Counter
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...practice.curves import PathPoint
from ...practice.references import PathSpec
from ..fly.flight_plan import Plan
from ..toml_tables import PATH_KEYS, TomlTable, read_plan
from ..vehicle_link import check_uri
from .separation import Separation


@dataclass(frozen=True)
class PlacedPath(PathSpec):
    """``centre_m``: where the origin of the path lies, x y z [m]."""

    centre_m: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def altitude_m(self) -> float:
        """Height to which the take-off goes."""
        return super().altitude_m + self.centre_m[2]

    def at(self, t: np.ndarray) -> PathPoint:
        """t (n,) s from the start of the path."""
        point = super().at(t)
        return point._replace(position_m=point.position_m + np.array(self.centre_m))


FEWEST, MOST = 2, 8
MOST_DELAY_S = 20.0
"""An armed vehicle that does not take off is disarmed by its firmware after 30 s."""
MISPLACED_M = 0.3
"""A vehicle further from its place in the plan may have been exchanged with another one."""
KEYS = ("name", "uri", "mocap", "place", "centre", *PATH_KEYS, "controller", "setpoints", "simulator", "delay_s",
        "yaw_deg")


@dataclass(frozen=True)
class FleetVehicle:
    """``place_m``: x, y of the vehicle on the ground; ``mocap``: its poses, None for those of the command line;
    ``delay_s``: take-off after the first possible moment."""

    name: str
    uri: str
    mocap: str | None
    place_m: tuple[float, float]
    path: PlacedPath
    controller: str
    setpoints: str | None
    simulator: Path | None
    delay_s: float
    yaw_deg: float

    def plan(self) -> Plan:
        """From its place, before the place is measured."""
        return Plan(self.path, np.array([*self.place_m, 0.0]), float(np.radians(self.yaw_deg)))

    def check_place(self, measured_m: np.ndarray) -> None:
        """Raises InputError for a vehicle that is elsewhere."""
        off = float(np.hypot(*(measured_m[:2] - self.place_m)))
        if off > MISPLACED_M:
            raise InputError(f"{self.name} ({self.uri})", f"is at ({measured_m[0]:.2f}, {measured_m[1]:.2f}) m, "
                             f"{off:.2f} m from its place", "exchanged with another vehicle? move it, or change place; "
                             "not armed")


@dataclass(frozen=True)
class FleetPlan:
    """Vehicles, and the distances between them."""

    vehicles: tuple[FleetVehicle, ...]
    separation: Separation


def read_fleet(path: Path) -> FleetPlan:
    """The plan in a file. Raises InputError in one line for every mistake."""
    table = read_plan(path, ("separation", "vehicle"))
    vehicles = tuple(_vehicle(entry, number) for number, entry in enumerate(table.tables("vehicle", KEYS), 1))
    if not FEWEST <= len(vehicles) <= MOST:
        raise InputError(str(path), f"has {len(vehicles)} [[vehicle]]", f"a fleet has {FEWEST} to {MOST}; fly one "
                         "without --fleet")
    for what, values in (("name", [v.name for v in vehicles]), ("uri", [v.uri for v in vehicles])):
        twice = next((value for value, count in Counter(values).items() if count > 1), None)
        if twice is not None:
            raise InputError(str(path), f"two vehicles have the {what} {twice!r}", f"give each a {what} that differs")
    names = tuple(field.name for field in fields(Separation))
    given = table.table("separation", names)
    usual = Separation()
    distances = {name: given.number(name, getattr(usual, name), 0.0, 5.0) for name in names}
    if distances["vertical_m"] < distances["horizontal_m"]:
        raise InputError(f"{path}: separation", f"vertical_m = {distances['vertical_m']:g} is below horizontal_m",
                         "downwash reaches further down than to the side")
    return FleetPlan(vehicles, Separation(**distances))


def _vehicle(entry: TomlTable, number: int) -> FleetVehicle:
    uri = entry.text("uri")
    try:
        check_uri(uri)
    except InputError as error:
        raise InputError(entry.place, f"uri = {uri!r}: {error.found}", error.advice) from None
    x, y = entry.numbers("place", 2)
    centre = entry.numbers("centre", 3, (x, y, 0.0))
    path = entry.path()
    return FleetVehicle(entry.text("name", f"vehicle {number}"), uri, entry.optional_text("mocap"), (x, y),
                        PlacedPath(path.family, path.speed, path.params, centre_m=(centre[0], centre[1], centre[2])),
                        entry.text("controller"), entry.optional_text("setpoints"), entry.file("simulator"),
                        entry.number("delay_s", 0.0, 0.0, MOST_DELAY_S), entry.number("yaw_deg", 0.0, -180.0, 180.0))
