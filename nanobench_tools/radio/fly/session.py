"""A flight from the URI to the recording: link, poses, checklist, flight, export."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...errors import InputError
from ...practice.references import PathSpec
from ...results.result import to_json
from ..blocks import Block
from ..host_clock import Clock, HostClock
from ..mocap.pose_source import PoseSource
from ..record_export import Exported, export
from ..recorder import Recorder, check_folder, recording_name
from ..vehicle_link import FLYING, CflibLink, check_uri, open_link
from .checklist import check_tables, health_blocks
from .companion import companion
from .company import ALONE, GROUND_S, Company
from .flight_plan import Plan
from .keys import space_stops
from .mission import Flight
from .motor_test import check_motors
from .outcome import Listener, Outcome, TrackingError, summary
from .pilot import Pilot
from .pose_feed import Feed
from .prepare import Preparation, Ready
from .safety import Limits
from .stop_socket import listening
from .watch import Watch

HOST = HostClock()
STARTS_S = 60.0
"""Limit for a vehicle that does not answer yet: a simulated one compiles for half a minute at its first start."""


@dataclass(frozen=True)
class Request:
    """Request for a flight. ``record_to``: folder, or None; ``blocks`` of the recording; ``quiet``: no display;
    ``say`` takes one line a step; ``cache``: folder for the vehicle's tables; ``confirm`` is called before the vehicle
    is armed, and raises to refuse; ``check_motors``: test them before; ``motor_tests``: file with earlier tests;
    ``sheet``: further entries for the recording's sheet; ``company``: others in the air;
    ``label``: begins the name of the recording."""

    spec: PathSpec
    pilot: Pilot
    limits: Limits
    uri: str
    source: PoseSource
    blocks: Sequence[Block]
    yaw_rad: float = 0.0
    record_to: Path | None = None
    quiet: bool = True
    say: Callable[[str], None] = lambda text: None
    cache: Path | None = None
    clock: Clock = HOST
    confirm: Callable[[Ready], None] = lambda ready: None
    check_motors: bool = False
    motor_tests: Path | None = None
    sheet: Mapping[str, Any] = field(default_factory=dict)
    company: Company = ALONE
    label: str = ""


@dataclass(frozen=True)
class Result:
    """Result of a flight. ``recording`` as exported, None if not requested or not waited for. ``raw``: its packets as
    they came."""

    outcome: Outcome
    ready: Ready
    recording: Exported | None
    raw: Path | None
    tracking: TrackingError = field(default_factory=TrackingError)


def is_simulated(uri: str, source: PoseSource) -> bool:
    """Whether what is recorded is made up: real vehicles have no UDP."""
    return uri.startswith(("udp://", "virtual://")) or source.synthetic


def sheet_of(request: Request) -> dict[str, Any]:
    """Properties known before the flight, in the words of the format's sheets."""
    spec = request.spec
    return {"trajectory_type": spec.family, "trajectory_id": spec.trajectory_id, "category": "flown", "repetition": 1,
            "crazyflie_id": request.uri, "params": dict(spec.params), "controller": request.pilot.name,
            "setpoints": request.pilot.kind, "synthetic": is_simulated(request.uri, request.source), **request.sheet}


def fly_session(request: Request) -> Result:
    """Raises InputError for any reason not to fly, before arming."""
    check_uri(request.uri)
    if request.record_to is not None:
        check_folder(request.record_to)
    recorder: Recorder | None = None
    with ExitStack() as stack:
        clock, company = request.clock, request.company
        helper = stack.enter_context(companion(request.uri)) if clock.real else None
        link = stack.enter_context(open_link(request.uri, clock, request.cache, STARTS_S, request.say))
        check_tables(request.uri, set(link.log_types), link.parameters)
        running = link.start_blocks([*health_blocks(), *(request.blocks if request.record_to is not None else ())])
        feed = Feed(link, request.source)
        stack.callback(feed.close)
        feed.start()

        def check(open_: CflibLink) -> None:
            check_motors(open_, clock, request.say, request.motor_tests)

        ready = Preparation(link, feed.track, clock, request.limits, request.source.name, feed.switch,
                            request.say, request.confirm, check if request.check_motors else None).run(
            request.pilot, lambda place, yaw: Plan(request.spec, place, yaw), request.yaw_rad)
        stack.callback(_disarm, link)  # in case that something fails before or after the flight
        if helper is not None:
            helper.port(link.udp_port)
            helper.ground_m = float(ready.pose.position_m[2])
        watch = Watch(link, quiet=request.quiet or not company.single)
        tracking = TrackingError()
        listeners: list[Listener] = [watch, tracking, *([helper] if helper is not None else [])]
        if request.record_to is not None:
            name = recording_name([request.label, request.spec.trajectory_id, request.pilot.name], clock.now())
            sheet = sheet_of(request) | {"battery_at_rest_V": ready.battery_V}
            recorder = Recorder(request.record_to, name, link, running, sheet, clock)
            stack.callback(recorder.close)
            recorder.hosted = request.pilot.hosted
            feed.on_pose = recorder.pose
            recorder.start()
            listeners.append(recorder)
        flight = Flight(link, feed.track, request.pilot, ready, request.limits, clock, tuple(listeners), feed.sent,
                        ground_s=company.ground_s(clock), gate=feed.gate, feed=feed.switch, company=company)
        company.flies(flight.interrupts)
        watch.beat_of = lambda: flight.pacer.beat
        if recorder is not None:
            recorder.beat_of = watch.beat_of
        keys = (space_stops(lambda: flight.interrupts.stop("space bar")) if clock.real and company.single
                else nullcontext())
        requests = (listening(request.uri, lambda: flight.interrupts.stop("nanobench stop")) if clock.real
                    else nullcontext())
        with watch, keys, requests:
            outcome = flight.run()
        if recorder is not None:
            if not outcome.left:
                clock.sleep_until(clock.now() + GROUND_S)
            feed.on_pose = None
            recorder.sheet({"flight": to_json(summary(outcome, ready), nan=float)})
    raw = None if recorder is None else recorder.path
    return Result(outcome, ready, _exported(raw, outcome, request), raw, tracking)


def _disarm(link: CflibLink) -> None:
    """The vehicle does not stay armed, except in flight."""
    if not int(link.values.get("supervisor.info", 0)) & FLYING:
        link.arm(False)


def _exported(raw: Path | None, outcome: Outcome, request: Request) -> Exported | None:
    """None if nobody waits for it, or if a flight that was stopped left too little: why it was is worth more."""
    if raw is None or outcome.left:
        return None
    try:
        return export(raw, request.record_to)
    except InputError as error:
        if outcome.stop is None:
            raise
        request.say(f"not exported: {error}")
        return None
