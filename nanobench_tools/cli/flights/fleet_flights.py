"""``nanobench fly --fleet``: two to eight vehicles at once, one recording each."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...errors import UsageError
from ...results.result import Result
from ...steps.options import Options
from ...tables.result_table import Table
from ..closing import again, close
from ..record import say_export
from .flight_controllers import pilot_for
from .flight_requests import FlightOptions, confirmation
from .recorded_flight import audit_recording

if TYPE_CHECKING:
    from ...radio.fleet.fleet_plan import FleetPlan, FleetVehicle
    from ...radio.fleet.fleet_session import Flown
    from ...radio.fly.session import Request

INTERRUPTED = 130


@dataclass(frozen=True, repr=False)
class FleetBody(Result):
    """fly.json of a fleet. ``vehicles``: name, uri, controller, trajectory, why it landed early, tracking error [m] and
    recording of each. ``pairs``: names and smallest planned horizontal distance [m]."""

    vehicles: Sequence[dict[str, Any]]
    pairs: Sequence[dict[str, Any]]


def fly_fleet(options: Options, file: Path, common: FlightOptions, mocap: str | None, dry_run: bool) -> int:
    """Checks the plans of all vehicles from their places in the file, then flies them."""
    from ...radio.fleet.fleet_plan import read_fleet
    from ...radio.fleet.fleet_session import Fleet
    from ...radio.fleet.separation import check_plans
    from ...radio.fly.checklist import check_plan

    plan = read_fleet(file)
    pilots = [pilot_for(v.controller, v.setpoints, v.simulator) for v in plan.vehicles]
    for vehicle in plan.vehicles:
        check_plan(vehicle.plan(), common.limits)
    near = check_plans({v.name: (v.plan(), v.delay_s) for v in plan.vehicles}, plan.separation)
    if dry_run:
        close(options, f"{len(plan.vehicles)} plans keep their distances; nothing was sent", "their simulated vehicles",
              "nanobench", "simulate", "--fleet", file, screen=[pairs_table(near)])
        return options.finish("fly", FleetBody([], pairs_of(near)))
    requests = []
    for vehicle, pilot in zip(plan.vehicles, pilots, strict=True):
        poses = vehicle.mocap or mocap
        if poses is None:
            raise UsageError(f"{vehicle.name} has no mocap; give --mocap SOURCE, or mocap in {file}")
        requests.append(common.request(
            options, vehicle.path, pilot, vehicle.uri, poses, yaw_rad=math.radians(vehicle.yaw_deg),
            confirm=lambda ready: None))  # once for all
    flown = Fleet(plan.vehicles, requests, plan.separation, confirm_all(plan, requests, common.yes)).fly()
    return _report(options, flown, near)


def confirm_all(plan: FleetPlan, requests: Sequence[Request], yes: bool) -> Callable[[], None]:
    """One question for all vehicles, if any is real."""
    from ...radio.fly.session import is_simulated

    simulated = all(is_simulated(request.uri, request.source) for request in requests)
    ask = confirmation(plan.vehicles[0].uri, simulated, yes)
    return lambda: ask(None)


def _report(options: Options, flown: Sequence[Flown], near: Sequence[tuple[str, str, float]]) -> int:
    rows, entries, interrupted = [], [], False
    for one in flown:
        entry = _entry(options, one)
        entries.append(entry)
        rows.append((entry["name"], entry["controller"], entry["trajectory"],
                     "-" if entry["rmse_m"] is None else f"{100.0 * entry['rmse_m']:.1f}",
                     entry["stopped"] or "flown"))
        if entry["stopped"] is not None:
            options.failed.append({"item": "fly", "file": one.vehicle.uri,
                                   "error": f"{one.vehicle.name}: {entry['stopped']}"})
            stop = None if one.result is None else one.result.outcome.stop
            interrupted = interrupted or (stop is not None and stop.rule == "interrupted")
    table = Table.plain("Flights of the fleet", ("vehicle", "controller", "trajectory", "RMSE cm", "end"), rows)
    early = sum(entry["stopped"] is not None for entry in entries)
    said = f"{len(flown)} vehicles: " + (f"{early} landed early" if early else "flown")
    recordings = [entry["recording"] for entry in entries if entry["recording"] is not None]
    following = ("are they good recordings", ["nanobench", "audit", *recordings]) if recordings else (
        "fly them again and keep it", again("--record", "flights"))
    close(options, said, following[0], *following[1], screen=[table])
    code = options.finish("fly", FleetBody(entries, pairs_of(near)))
    return INTERRUPTED if interrupted else code


def _entry(options: Options, one: Flown) -> dict[str, Any]:
    """One vehicle of fly.json; reports and audits its recording."""
    vehicle: FleetVehicle = one.vehicle
    entry: dict[str, Any] = {"name": vehicle.name, "uri": vehicle.uri, "controller": vehicle.controller,
                             "trajectory": vehicle.path.trajectory_id, "stopped": None, "rmse_m": None,
                             "recording": None}
    if one.result is None:
        return {**entry, "stopped": str(one.given_up or one.error)}
    stop, tracking = one.result.outcome.stop, one.result.tracking
    entry |= {"stopped": None if stop is None else str(stop),
              "rmse_m": tracking.rmse_m if math.isfinite(tracking.rmse_m) else None}
    if one.result.recording is not None:
        quiet = replace(options, quiet=True)
        entry["recording"] = say_export(quiet, one.result.recording).csv
        audit_recording(options, one.result.recording.csv, one.result.recording.parquet)
    elif one.result.raw is not None:
        options.say(f"{vehicle.name}: the raw recording is in {one.result.raw}; nanobench record --export makes a "
                    "recording of it")
    return entry


def pairs_of(near: Sequence[tuple[str, str, float]]) -> list[dict[str, Any]]:
    """Planned distances for fly.json."""
    return [{"vehicles": [one, other], "least_m": distance} for one, other, distance in near]


def pairs_table(near: Sequence[tuple[str, str, float]]) -> Table:
    """Planned distances."""
    return Table.plain("Smallest planned horizontal distance", ("vehicle", "and", "m"),
                       [(one, other, f"{distance:.2f}") for one, other, distance in near])
