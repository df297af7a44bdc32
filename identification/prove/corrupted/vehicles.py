"""Vehicles whose recordings with motion capture are public: where they are, what they weigh, and what drives them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight, make_stream
from nanobench_tools.physics import Vehicle


@dataclass(frozen=True)
class VehicleSource:
    """One vehicle. ``folder``: below the root of the recordings; ``vehicle``: mass, input; ``train``, ``groups``,
    ``of_a_group``: flights that fit the nominal simulator, number of groups, and flights of each; ``label``: entry
    of ``labels.json`` that its flights have; ``estimated_pose``: the logged estimate, which motion capture fed, is
    the pose; ``fit``: ``vehicle`` (motor commands, as ``nanobench sysid``), ``along`` (forces and moments along the
    measured states);
    ``credit``: source of the recordings."""

    name: str
    folder: str
    vehicle: Vehicle
    train: int
    groups: int
    of_a_group: int
    fit: str
    credit: str
    label: tuple[str, float] | None = None
    estimated_pose: bool = False


VEHICLES = (
    VehicleSource("nanobench", "nanobench/datasets/dataset", Vehicle(), 10, 4, 6, "vehicle",
                  "github syediu/nanobench-iros2026: brushed, motor commands at 100 Hz"),
    VehicleSource("brushless", "crazyflie_usd/brushless_flights", Vehicle(mass_kg=0.037, input="rpm"), 4, 2, 4, "along",
                  "github IMRCLab/crazyflie-data-collection: rotor speed at 500 Hz"),
    VehicleSource("payload", "crazyflie_usd/brushless_payload", Vehicle(mass_kg=0.0444, input="rpm"), 4, 2, 5, "along",
                  "the same with 4.7 g more"),
    VehicleSource("brushed", "crazyflie_usd/brushed_flights", Vehicle(mass_kg=0.0347, input="rpm"), 5, 2, 4, "along",
                  "the same repository: brushed, rotor speed at 500 Hz"),
    VehicleSource("lee_upgraded", "crazyswarm_lee", Vehicle(mass_kg=0.0375, input="thrust"), 8, 3, 6, "along",
                  "github IMRCLab/crazyswarm2-tools: collective command in N", ("upgraded", 0.0375), True),
    VehicleSource("lee_standard", "crazyswarm_lee", Vehicle(mass_kg=0.032, input="thrust"), 5, 1, 4, "along",
                  "the same repository", ("standard", 0.032), True),
)


def named(names: Sequence[str]) -> list[VehicleSource]:
    """Vehicles by name; InputError for an unknown one."""
    known = {v.name: v for v in VEHICLES}
    for name in names:
        if name not in known:
            raise InputError("--vehicle", f"{name} is unknown", f"there are {', '.join(known)}")
    return [known[name] for name in names]


def paths_of(source: VehicleSource, root: Path) -> list[Path]:
    """Files of a vehicle's recordings below ``root``, sorted; none where they are absent."""
    folder = root / source.folder
    if not folder.is_dir():
        return []
    files = sorted(p for p in folder.iterdir() if p.is_file() and p.suffix in ("", ".xz"))
    if source.label is None:
        return files
    labels = json.loads((folder / "labels.json").read_text())
    return [p for p in files if tuple(labels.get(p.stem, ())) == source.label]


def with_pose(flight: Flight) -> Flight:
    """With the logged estimate as the pose of the motion capture that fed it."""
    estimate = flight["estimator"]
    if "mocap" in flight:
        return flight
    return flight.with_streams(mocap=make_stream("mocap", estimate.time_s, estimate["x", "y", "z"], ("px", "py", "pz"),
                                                 rate_hz=estimate.rate_hz))
