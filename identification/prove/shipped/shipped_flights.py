"""Real flights of the vehicle of a case, and the nominal simulator that other flights of the vehicle give."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from identification.prove.corrupted.groups import TRACKS, Group, dealt, groups_of, looked_over
from identification.prove.corrupted.kept_results import READING, code_hash, hashes, kept, key_of
from identification.prove.corrupted.nominal import as_json, from_values
from identification.prove.corrupted.vehicles import VehicleSource, named, paths_of
from identification.prove.hidden_speed import SPEED, simulator_item
from nanobench_tools.physics import Vehicle
from nanobench_tools.physics.simulator import loads
from nanobench_tools.sources.discover import load_recordings
from nanobench_tools.version import __version__

COMMANDS = "brushed_commands"
"""The brushed vehicle as a simulator of motor commands sees it. Rotor speeds make the nominal simulator and its lag.
They are hidden in the flights that are diagnosed."""
MOST_FLIGHTS = 4
"""Of a vehicle: a diagnosis of more takes minutes."""
OF_COMMANDS = ("identification/prove/hidden_speed.py", "identification/motors/*")


def source_of(vehicle: str) -> VehicleSource:
    """Where the recordings of a case are."""
    if vehicle != COMMANDS:
        source = named([vehicle])[0]
        return replace(source, of_a_group=min(source.of_a_group, MOST_FLIGHTS))
    brushed = named(["brushed"])[0]
    return replace(brushed, name=COMMANDS, vehicle=Vehicle(mass_kg=brushed.vehicle.mass_kg))


def group_of(vehicle: str, root: Path, say: Callable[[str], None] = lambda text: None) -> Group | None:
    """The first group of a vehicle, as of ``prove --corrupted``; None where its recordings are absent."""
    source = source_of(vehicle)
    if vehicle == COMMANDS:
        return _commanded(source, root, say)
    found = groups_of(source, root, 1, say)
    return found[0] if found else None


def _commanded(source: VehicleSource, root: Path, say: Callable[[str], None]) -> Group | None:
    hands = dealt(paths_of(source, root), source.groups + 1, [source.train, *([source.of_a_group] * source.groups)])
    if not hands or len(hands[0]) < source.train:
        return None
    train, group = hands[:2]
    say(f"{source.name}: nominal simulator from {len(train)} flights")
    mark = key_of("nominal", source, hashes(train), __version__, code_hash(OF_COMMANDS))

    def fitted() -> dict[str, Any]:
        item = simulator_item(load_recordings(train).flights, source.vehicle.mass_kg, 0)
        return as_json(loads(item["simulator"]))

    nominal = from_values(kept(mark, dict[str, Any], fitted))
    say(f"{source.name}: {len(group)} flights, rotor speed hidden")
    flights = [flight.without_streams(SPEED) for flight in load_recordings(group).flights]
    return Group(source.name, 0, looked_over(flights, source), nominal,
                 key_of(as_json(nominal), hashes(group), code_hash((*READING, *TRACKS))))
