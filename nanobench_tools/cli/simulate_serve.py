"""``nanobench simulate --serve``: a simulated Crazyflie for cflib, until Ctrl-C."""

from __future__ import annotations

import functools
import ipaddress
import math
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import InputError, UsageError, how_to_install
from ..steps.options import Options
from .shared_options import PATH, FiniteRange

if TYPE_CHECKING:
    from ..radio.simulated.server import SimulatedCrazyflie

MOST_VEHICLES = 10
"""cflib scans so many ports."""
DEFAULT_PORT = 19850
SWITCH_S = 0.0005
"""A vehicle's thread waits no longer than this for another one's; Python's own 5 ms is half a turn of ten."""


class Numbers(click.ParamType):  # type: ignore[type-arg]  # click 8.1 takes no argument there
    """``1,2,3``: so many numbers."""

    name = "numbers"

    def __init__(self, count: int) -> None:
        self.count = count

    def convert(self, value: Any, parameter: click.Parameter | None, context: click.Context | None,
                ) -> tuple[float, ...]:
        try:
            found = tuple(float(part) for part in str(value).split(","))
        except ValueError:
            found = ()
        if len(found) != self.count or not all(abs(x) < 1e6 for x in found):
            self.fail(f"{value!r} is not {self.count} numbers with commas between", parameter, context)
        return found


_OPTIONS: tuple[Callable[..., Any], ...] = (
    click.option("--serve", "serve_uri", metavar="URI", help="Serve a simulated Crazyflie: udp://127.0.0.1:19850. Its "
                 "motion capture is at the port + 100."),
    click.option("--vehicles", type=click.IntRange(1, MOST_VEHICLES), metavar="N", help="Served: so many, at ports one "
                 "after another."),
    click.option("--fleet", type=PATH, metavar="FILE", help="Serve the vehicles of a plan of fly --fleet, at their "
                 "addresses and places."),
    click.option("--simulator", type=PATH, metavar="FILE", help="Served: its physics, simulator.toml. Default: the "
                 "recorded vehicle."),
    click.option("--battery", "battery_V", type=float, metavar="V", help="Served: its cell at rest."),
    click.option("--swap-battery", is_flag=True, default=None, help="Served: every client finds the vehicle at its "
                 "start with a battery as at first."),
    click.option("--wind", "wind_m_s", type=Numbers(3), metavar="X,Y,Z", help="Served: the air moves so [m/s]."),
    click.option("--start", type=Numbers(4), metavar="X,Y,Z,YAW",
                 help="Served: initial position and heading [m, deg]."),
    click.option("--deck", "positioning", is_flag=True, default=None,
                 help="Served: a deck measures the position, so no poses need be sent."),
    click.option("--latency-s", type=float, metavar="S", help="Served: of the radio, one way."),
    click.option("--latency-jitter-s", "jitter_s", type=float, metavar="S", help="Served: mean of a random delay on "
                 "top."),
    click.option("--loss", type=float, metavar="P", help="Served: share of set-points, poses and log packets "
                 "lost; all else is sent again."),
    click.option("--bandwidth", "packets_per_s", type=float, metavar="HZ", help="Served: packets a second that reach "
                 "the client; 690 for nine blocks of 77 Hz, as recorded."),
    click.option("--hangs", type=Numbers(2), metavar="N,S", help="Served: nothing passes, N times a second for S "
                 "seconds in the mean, such as 2,0.06."),
    click.option("--mocap-hz", "mocap_hz", type=float, metavar="HZ", help="Served: poses a second. Default: 100."),
    click.option("--mocap-noise-m", type=float, metavar="M", help="Served: noise of poses. Default: 0.0003."),
    click.option("--mocap-noise-rad", type=float, metavar="RAD", help="Served: of their turns. Default: 0.002."),
    click.option("--mocap-delay-s", type=float, metavar="S", help="Served: from exposure to sending."),
    click.option("--clock-drift", "ticks_ppm", type=float, metavar="PPM", help="Served: its ticks are this much too "
                 "fast."),
    click.option("--boot-offset-s", type=float, metavar="S", help="Served: switched on so long before. Default: 1."),
    click.option("--pace", type=FiniteRange(0.1, 20.0), metavar="X", help="Served: seconds of its world in one of "
                 "ours."),
    click.option("--bind-anywhere", is_flag=True, default=None, help="Served: allow an address that others on the net "
                 "can reach."),
)
SERVE_OPTIONS = ("vehicles", "fleet", "simulator", "battery_V", "swap_battery", "wind_m_s", "start", "positioning",
                 "latency_s", "jitter_s", "loss", "packets_per_s", "hangs", "mocap_hz", "mocap_noise_m",
                 "mocap_noise_rad", "mocap_delay_s", "ticks_ppm", "boot_offset_s", "pace", "bind_anywhere")


def serve_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """Puts the options of a served vehicle on a verb."""
    for option in reversed(_OPTIONS):
        function = option(function)
    return function


def address(uri: str, anywhere: bool) -> tuple[str, int]:
    """Host and port of udp://host:port; UsageError for another kind, or one that others can reach unless allowed."""
    kind, _, rest = uri.partition("://")
    host, _, port = rest.partition(":")
    if kind != "udp" or not host or (port and not port.isdigit()):
        raise UsageError(f"--serve {uri}: give udp://HOST:PORT, such as udp://127.0.0.1:{DEFAULT_PORT}")
    host = "127.0.0.1" if host == "localhost" else host
    try:
        own = ipaddress.ip_address(host).is_loopback
    except ValueError:
        raise UsageError(f"--serve {uri}: {host!r} is no address of numbers") from None
    if not own and not anywhere:
        raise UsageError(f"--serve {uri}: others could reach it there, and CRTP knows no password; 127.0.0.1, or add "
                         "--bind-anywhere")
    number = int(port) if port else DEFAULT_PORT
    if not 1 <= number <= 65435:
        raise UsageError(f"--serve {uri}: port {number}; give 1 to 65435")
    return host, number


def serve(options: Options, uri: str | None, given: dict[str, Any]) -> int:
    """Serves until Ctrl-C or for so many seconds."""
    spots = _spots(uri, given)
    if len(spots) > 1:
        sys.setswitchinterval(SWITCH_S)
    with ExitStack() as stack:
        served = [stack.enter_context(vehicle) for vehicle in _made(options, spots, given)]
        for one in served:
            options.say(f"serving {one.uri}, poses at udp://{one.mocap_address[0]}:{one.mocap_address[1]}; Ctrl-C ends")
        until = time.monotonic() + given["seconds"] if given["seconds"] is not None else float("inf")
        try:
            while time.monotonic() < until:
                time.sleep(0.1)
                for one in served:
                    if one.broken is not None:
                        raise one.broken
        except KeyboardInterrupt:
            pass
        for one in served:
            options.say(f"{one.uri}: {one.summary()}")
    return 0


@dataclass(frozen=True)
class Spot:
    """Address and start of a served vehicle: x, y, z [m] and heading [deg]."""

    host: str
    port: int
    start: tuple[float, float, float, float]


def _spots(uri: str | None, given: dict[str, Any]) -> list[Spot]:
    """Of a fleet's plan, or one after another from an address on."""
    anywhere = bool(given["bind_anywhere"])
    if given["fleet"] is None:
        host, port = address(str(uri), anywhere)
        x, y, z, yaw = given["start"] or (0.0, 0.0, 0.0, 0.0)
        return [Spot(host, port + i, (x, y + 0.5 * i, z, yaw)) for i in range(given["vehicles"] or 1)]
    if uri is not None or given["vehicles"] is not None or given["start"] is not None:
        raise UsageError("--fleet FILE has the addresses and places; leave out --serve, --vehicles and --start")
    from ..radio.fleet.fleet_plan import read_fleet

    return [Spot(*address(vehicle.uri, anywhere), (*vehicle.place_m, 0.0, vehicle.yaw_deg))
            for vehicle in read_fleet(given["fleet"]).vehicles]


def _made(options: Options, spots: Sequence[Spot], given: dict[str, Any]) -> Sequence[SimulatedCrazyflie]:
    """The vehicles, not yet served; their seeds follow one another."""
    from ..radio.simulated.channel import RadioOptions
    from ..radio.simulated.motion_capture import MocapOptions
    from ..radio.simulated.onboard_services import Build
    from ..radio.simulated.server import SimulatedCrazyflie

    hangs = given["hangs"] or (0.0, 0.0)

    def air(seed: int) -> tuple[RadioOptions, MocapOptions]:
        radio = RadioOptions(**_some(given, latency_s="latency_s", jitter_s="jitter_s", loss="loss",
                                     packets_per_s="packets_per_s"), hangs_per_s=hangs[0], hang_s=hangs[1], seed=seed)
        mocap = MocapOptions(**_some(given, rate_hz="mocap_hz", noise_m="mocap_noise_m", noise_rad="mocap_noise_rad",
                                     delay_s="mocap_delay_s"),
                             seed=seed)
        return radio, mocap

    airs, found = [air(options.seed + i) for i in range(len(spots))], []  # refused before the vehicle is made
    for spot, vehicle, (radio, mocap) in zip(spots, _vehicles(options, spots, given), airs, strict=True):
        found.append(SimulatedCrazyflie(
            vehicle, spot.host, spot.port, radio=radio, mocap=mocap, drift_ppm=given["ticks_ppm"] or 0.0,
            build=Build(positioning=bool(given["positioning"])), pace=given["pace"] or 1.0,
            swap_battery=bool(given["swap_battery"]), report=functools.partial(_report, options, spot.port)))
    return found


def _report(options: Options, port: int, line: str) -> None:
    options.say(f"{port}: {line}")


def _vehicles(options: Options, spots: Sequence[Spot], given: dict[str, Any]) -> list[Any]:
    try:
        from controllers.plants.downwash import SharedAir
        from controllers.plants.served_vehicle import served
    except ImportError as error:
        raise UsageError(f"the plant is not installed: {error}; {how_to_install('mpc')}") from error

    simulator: Path | None = given["simulator"]
    boot_s = 1.0 if given["boot_offset_s"] is None else given["boot_offset_s"]
    if not 0.0 <= boot_s <= 1e6:
        raise InputError("--boot-offset-s", f"{boot_s:g} s", "give 0 to 1e6")
    options.say("making the vehicle (the first time its code is compiled, which takes a minute)")
    found = [served(simulator, start_m=spot.start[:3], yaw_rad=math.radians(spot.start[3]), seed=options.seed + i,
                    tick_ms=round(1000.0 * boot_s), **_some(given, battery_V="battery_V", wind_m_s="wind_m_s"))
             for i, spot in enumerate(spots)]
    SharedAir(found)
    return found


def _some(given: dict[str, Any], **names: str) -> dict[str, Any]:
    """Those of the options that were given, by the names they have elsewhere."""
    return {to: given[name] for to, name in names.items() if given[name] is not None}
