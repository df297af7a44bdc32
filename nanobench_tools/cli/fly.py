"""``nanobench fly``: a controller flies a path with a vehicle behind a link, under safety rules."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..errors import UsageError
from ..results.result import INLINE, OPTIONAL, Result
from ..steps.options import Options, one_line
from ..tables.result_table import Table
from .closing import again, close, shown_page
from .flights.campaign_flights import fly_campaign
from .flights.fleet_flights import fly_fleet
from .flights.flight_controllers import CONTROLLERS_HELP, pilot_for
from .flights.flight_requests import FlightOptions, refuse_given
from .flights.recorded_flight import audit_recording
from .record import RecordBody, say_export
from .shared_options import PATH, FiniteRange, shared_options

if TYPE_CHECKING:
    from ..practice.references import PathSpec
    from ..radio.fly.outcome import FlightSummary
    from ..radio.fly.pilot import Pilot
    from ..radio.fly.safety import Limits
    from ..radio.fly.session import Request

KINDS = ("thrust-rates", "full-state", "velocity", "position")
INTERRUPTED = 130
MAY_FALL = ("lost link", "supervisor", "emergency stop", "interrupted")
"""Reasons after which it is not certain that the vehicle landed."""
OWN_MODEL = ("{} plans with the recorded vehicle, the model of a simulated vehicle that is served without --simulator. "
             "Do not expect its tracking error of a real one")


@click.command()
@shared_options("data", "columns", "jobs", "scheduler", "clock", "seed")
@click.option("--controller", metavar="NAME", help=CONTROLLERS_HELP)
@click.option("--trajectory", default="figure_eight", show_default=True, metavar="NAME",
              help="Family of paths, see --list.")
@click.option("--speed", type=FiniteRange(min=0.05, max=5.0), metavar="M_S", help="Along the path. Default: the "
              "family's slow one.")
@click.option("--size", type=FiniteRange(min=0.05, max=20.0), metavar="M", help="Radius or half width.")
@click.option("--seconds", type=FiniteRange(min=4.0, max=600.0), metavar="S", help="Length of the path.")
@click.option("--uri", metavar="URI", help="Of the vehicle: radio://0/80/2M/E7E7E7E7E7, udp://127.0.0.1:19850, ...")
@click.option("--mocap", metavar="SOURCE", help="simulated, TYPE://HOST/BODY of the package motioncapture, or "
              "module:callable. TYPE is vicon, optitrack, qualisys, vrpn, ...")
@click.option("--record", "record_to", type=PATH, metavar="DIR", help="Record the flight into this folder.")
@click.option("--blocks", type=PATH, metavar="FILE", help="Log blocks (YAML) of the recording.")
@click.option("--setpoints", type=click.Choice(KINDS), help="Kind of set-points to send. Default: position for the "
                                                            "vehicle's own "
              "controllers, full-state for mellinger_full, thrust-rates for all others.")
@click.option("--simulator", type=PATH, metavar="FILE", help="simulator.toml that a predictive controller plans with. "
              "Default: the recorded vehicle.")
@click.option("--dry-run", is_flag=True, help="Print what would be sent; no link.")
@click.option("--yaw", "yaw_deg", type=FiniteRange(-180.0, 180.0), default=0.0, show_default=True, metavar="DEG",
              help="Where the vehicle looks on the ground.")
@click.option("--fence", nargs=6, type=float, default=(-2.0, 2.0, -2.0, 2.0, -0.1, 2.0), show_default=True,
              metavar="X X Y Y Z Z", help="Box [m] that it must not leave.")
@click.option("--tilt-limit", "tilt_deg", type=FiniteRange(5.0, 90.0), default=50.0, show_default=True,
              metavar="DEG")
@click.option("--speed-limit", type=FiniteRange(0.1, 20.0), default=3.0, show_default=True, metavar="M_S")
@click.option("--battery-limit", type=FiniteRange(2.5, 4.2), default=2.9, show_default=True, metavar="V",
              help="Mean of a second under load below which it lands.")
@click.option("--check-motors", is_flag=True, help="Turn every motor for a moment before take-off, and refuse to fly "
              "if a motor or propeller is not as the others and as usual.")
@click.option("--yes", is_flag=True, help="Arm a real vehicle without asking, for scripts.")
@click.option("--campaign", type=PATH, metavar="FILE", help="Plan (TOML) of repeated flights of alternated "
              "controllers, in pairs of equal battery voltage; see docs/flying.md.")
@click.option("--fleet", type=PATH, metavar="FILE", help="Plan (TOML) of two to eight vehicles that fly at once; see "
              "docs/flying.md.")
def fly(options: Options, controller: str | None, trajectory: str, speed: float | None, size: float | None,
        seconds: float | None, uri: str | None, mocap: str | None, record_to: Path | None, blocks: Path | None,
        setpoints: str | None, simulator: Path | None, dry_run: bool, yaw_deg: float, fence: tuple[float, ...],
        tilt_deg: float, speed_limit: float, battery_limit: float, check_motors: bool, yes: bool,
        campaign: Path | None, fleet: Path | None) -> int:
    """Fly a path: checklist, take-off, fade-in, path, fade-out, landing, at 100 Hz.

    A broken rule (fence, pose, battery, tilt, speed, controller, deadlines, link, Ctrl-C) ends the flight. The vehicle
    holds its place and lands, and the exit line gives the reason. Nothing is armed when a check fails.
    The space bar or a second Ctrl-C stops the motors at once."""
    from ..radio.fly.flight_plan import chosen_path
    from ..radio.fly.predictive import PlannedPilot
    from ..radio.fly.safety import Limits

    limits = Limits(fence_m=tuple(fence), tilt_deg=tilt_deg,  # type: ignore[arg-type]
                    speed_m_s=speed_limit, battery_V=battery_limit)
    common = FlightOptions(limits, record_to, blocks, yaw_deg, check_motors, yes)
    if campaign is not None:
        refuse_given("--campaign", "fleet", "controller", "trajectory", "speed", "size", "seconds", "setpoints",
                     "simulator", "dry_run")
        return fly_campaign(options, campaign, common, uri, mocap)
    if fleet is not None:
        refuse_given("--fleet", "campaign", "controller", "trajectory", "speed", "size", "seconds", "setpoints",
                     "simulator", "uri", "yaw_deg")
        return fly_fleet(options, fleet, common, mocap, dry_run)
    if controller is None:
        raise UsageError("--controller NAME is needed (or --campaign FILE, --fleet FILE)")
    spec = chosen_path(trajectory, speed, size, seconds)
    pilot = pilot_for(controller, setpoints, simulator)
    if uri is not None and uri.startswith("udp://") and simulator is None and isinstance(pilot, PlannedPilot):
        options.say(OWN_MODEL.format(pilot.name))
    if dry_run:
        return _dry_run(options, spec, pilot, limits)
    if uri is None or mocap is None:
        raise UsageError("--uri URI and --mocap SOURCE are needed (or --dry-run)")
    return _fly(options, common.request(options, spec, pilot, uri, mocap))


def _dry_run(options: Options, spec: PathSpec, pilot: Pilot, limits: Limits) -> int:
    import numpy as np

    from ..radio.fly.checklist import check_plan
    from ..radio.fly.dry_run import rows
    from ..radio.fly.flight_plan import Plan

    plan = Plan(spec, np.zeros(3), 0.0)
    check_plan(plan, limits)
    sent = rows(plan, pilot, 0.5)
    cells = [(phase, f"{time_s:.2f}", one_line(text)) for phase, time_s, text in sent]
    first = [row for k, row in enumerate(cells) if not k or row[0] != cells[k - 1][0]]
    title, heads = f"{pilot.name}, {spec.family}: what would be sent", ("phase", "time s", "set-point")
    close(options, f"{len(sent)} set-points, every 0.5 s of 100 Hz; nothing was sent", "a simulated vehicle to fly",
          "nanobench", "simulate", "--serve", "udp://127.0.0.1:19850",
          screen=[Table.plain(f"{title}, first of each phase", heads, first)],
          detail=[Table.plain(title, heads, cells)])
    return options.finish("fly", {"synthetic": True, "sent": [list(row) for row in sent]})


@dataclass(frozen=True, repr=False)
class FlyBody(Result):
    """fly.json of a flight."""

    controller: str
    trajectory: str
    flown: FlightSummary = field(metadata=INLINE)
    recording: RecordBody | None = field(default=None, metadata=OPTIONAL)


def _fly(options: Options, request: Request) -> int:
    from ..radio.fly.outcome import summary
    from ..radio.fly.session import fly_session

    result = fly_session(request)
    outcome, ready = result.outcome, result.ready
    body = FlyBody(request.pilot.name, request.spec.trajectory_id, summary(outcome, ready))
    loop = body.flown.loop
    options.say(f"loop: {loop['ticks']} ticks, {loop['missed']} deadlines missed; begin p50 {loop['begin_p50_ms']:.2f} "
                f"p99 {loop['begin_p99_ms']:.2f} ms late, controller p50 {loop['call_p50_ms']:.2f} p99 "
                f"{loop['call_p99_ms']:.2f} ms")
    error = f", RMSE {100.0 * result.tracking.rmse_m:.1f} cm and at most {100.0 * result.tracking.largest_m:.1f} cm " \
            "from the path by its poses" if math.isfinite(result.tracking.rmse_m) else ""
    page: Path | None = None
    if result.recording is not None:
        body = replace(body, recording=say_export(options, result.recording))
        page = audit_recording(options, result.recording.csv, result.recording.parquet)
    elif result.raw is not None:
        options.say(f"the raw recording is in {result.raw}; nanobench record --export makes a recording of it")
    stop = outcome.stop
    early = "ended early" if stop is not None and stop.rule in MAY_FALL else "landed early"
    said = f"{request.pilot.name}, {request.spec.trajectory_id}: " + (f"{early}: {stop}" if stop else "flown") + error
    if page is not None:
        close(options, said, "its page", *shown_page(page))
    elif body.recording is not None:
        close(options, said, "is it a good recording", "nanobench", "audit", body.recording.csv)
    else:
        close(options, said, "fly it again and keep it", *again("--record", "flights"))
    if stop is not None:
        options.failed.append({"item": "fly", "file": request.uri, "error": f"{early}: {stop}"})
    code = options.finish("fly", body)
    return INTERRUPTED if stop is not None and stop.rule == "interrupted" else code
