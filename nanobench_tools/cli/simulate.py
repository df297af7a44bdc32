"""``nanobench simulate``: practice flights in the NanoBench format, labelled SYNTHETIC."""

from __future__ import annotations

from typing import Any

import click

from ..errors import UsageError
from .options import FiniteRange, Options, shared_options
from .simulate_serve import SERVE_OPTIONS, serve, serve_options

KNOWN = "pid, mellinger, a registered name or module:Class"


@click.command()
@shared_options("data", "columns", "jobs", "scheduler", "clock")
@click.option("--flights", type=click.IntRange(min=1), default=12, show_default=True, metavar="N", help="How many.")
@click.option("--family", "families", multiple=True, metavar="NAME",
              help="circle, figure_eight, helix, linear_ramp, oval, star, trefoil, lissajous, which are the default in "
                   "turn; multisine_sysid, random_waypoints, staircase_climb, hover_until_landing. May repeat.")
@click.option("--speed", "speeds", multiple=True, type=click.Choice(("slow", "medium", "fast")),
              help="May repeat. Default: all in turn.")
@click.option("--controller", "--method", "controller", metavar="NAME",
              help=f"{KNOWN}. Default: two of three pid, the others mellinger.")
@click.option("--duration", "duration_s", type=FiniteRange(min=1.0), metavar="S", help="Length of every path [s].")
@click.option("--offset-ms", type=float, default=0.0, show_default=True, help="The vehicle's stamps are this late.")
@click.option("--drift-ppm", type=float, default=0.0, show_default=True, help="The vehicle's clock is this fast.")
@click.option("--wander-ms", type=FiniteRange(min=0.0), default=0.0, show_default=True,
              help="Standard deviation of the sawtooth in the vehicle's stamps; the recordings have about 33.")
@click.option("--suffix", type=click.Choice((".csv", ".csv.gz", ".csv.xz")), default=".csv", show_default=True)
@serve_options
def simulate(options: Options, flights: int, families: tuple[str, ...], speeds: tuple[str, ...], controller: str | None,
             duration_s: float | None, offset_ms: float, drift_ppm: float, wander_ms: float, suffix: str,
             serve_uri: str | None, **served: Any) -> int:
    """Write practice flights through the whole logging chain into --out DIR: CSV and sheet, marked synthetic.

    The same seed gives the same files. With --serve URI nothing is written: a simulated Crazyflie is there for cflib,
    `nanobench fly` and `nanobench record` until Ctrl-C.
    """
    if serve_uri is not None:
        return serve(options, serve_uri, served)
    if any(served[name] is not None and served[name] is not False for name in SERVE_OPTIONS):
        raise UsageError("options of a served vehicle go with --serve URI")
    from ..practice import CONTROLLERS, FAMILIES, LoggingChain, write_practice
    from ..registry import names
    from ..signals.controller import RESERVED
    from .named_methods import load_methods

    if options.out is None:
        raise UsageError("--out DIR is needed")
    unknown = [name for name in families if name not in FAMILIES]
    if unknown:
        raise UsageError(f"--family: unknown name {unknown[0]!r}; known: {', '.join(FAMILIES)}")
    how: dict[str, Any] = {"families": families or None, "duration_s": duration_s}
    if speeds:
        how["speeds"] = speeds
    if controller in CONTROLLERS:
        how["controllers"] = (controller,)
    elif controller is not None:
        if ":" not in controller and controller not in names("controllers"):
            raise UsageError(f"--controller: unknown name {controller!r}; known: "
                             f"{', '.join([*CONTROLLERS, *names('controllers')])}; or give module:Class")
        own = load_methods("controllers", [controller])[0]
        if own.name in RESERVED:
            raise UsageError(f"--controller: {controller} is called {own.name!r}, which in recordings means what the "
                             f"onboard streams show; any name but {', '.join(RESERVED)} will do")
        how["controller"] = own
    chain = LoggingChain(offset_s=1e-3 * offset_ms, drift=1e-6 * drift_ppm, wander_sd_s=1e-3 * wander_ms)
    paths = write_practice(options.out, flights, options.seed, suffix=suffix, chain=chain,
                           progress=lambda done, n: options.say(f"{done} of {n} flown"), **how)
    options.say(f"{len(paths)} SYNTHETIC recordings written to {options.out}")
    return options.finish("simulate", {"synthetic": True, "files": [path.name for path in paths]})
