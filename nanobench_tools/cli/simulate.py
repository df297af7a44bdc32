"""``nanobench simulate``: practice flights in the NanoBench format, labelled SYNTHETIC."""

from typing import Any

import click

from ..errors import UsageError
from ..steps.options import Options
from .closing import close
from .shared_options import FiniteRange, shared_options
from .simulate_serve import SERVE_OPTIONS, serve, serve_options

KNOWN = "A registered name (see --list) or module:Class"

SHORTEST_S = 1.0
"""Of a path: less shows nothing."""


@click.command()
@shared_options("data", "columns", "jobs", "scheduler", "clock")
@click.option("--flights", type=click.IntRange(min=1), default=12, show_default=True, metavar="N", help="How many.")
@click.option("--trajectory", "families", multiple=True, metavar="NAME",
              help="circle, figure_eight, helix, linear_ramp, oval, star, trefoil, lissajous, which are the default in "
                   "turn; multisine_sysid, random_waypoints, staircase_climb, hover_until_landing. May repeat.")
@click.option("--speed", "speeds", multiple=True, type=click.Choice(("slow", "medium", "fast")),
              help="May repeat. Default: all in turn.")
@click.option("--controller", metavar="NAME",
              help=f"{KNOWN}. Default: two of three onboard_pid, the others onboard_mellinger.")
@click.option("--seconds", "duration_s", type=FiniteRange(min=0.0), metavar="S",
              help="Length of every path [s]; with --serve: end after this time.")
@click.option("--offset-ms", type=float, default=0.0, show_default=True, help="Delay of the vehicle's timestamps.")
@click.option("--drift-ppm", type=float, default=0.0, show_default=True, help="The vehicle's clock is this fast.")
@click.option("--wander-ms", type=FiniteRange(min=0.0), default=0.0, show_default=True,
              help="Standard deviation of the sawtooth in the vehicle's timestamps; the recordings have about 33.")
@click.option("--suffix", type=click.Choice((".csv", ".csv.gz", ".csv.xz")), default=".csv", show_default=True)
@serve_options
def simulate(options: Options, flights: int, families: tuple[str, ...], speeds: tuple[str, ...], controller: str | None,
             duration_s: float | None, offset_ms: float, drift_ppm: float, wander_ms: float, suffix: str,
             serve_uri: str | None, **served: Any) -> int:
    """Write practice flights through the whole logging chain into --out DIR: CSV and sheet, marked synthetic.

    The same seed gives the same files. With --serve URI nothing is written: a simulated Crazyflie is there for cflib,
    `nanobench fly` and `nanobench record` until Ctrl-C.
    """
    if serve_uri is not None or served["fleet"] is not None:
        return serve(options, serve_uri, {**served, "seconds": duration_s})
    if any(served[name] is not None and served[name] is not False for name in SERVE_OPTIONS):
        raise UsageError("options of a served vehicle go with --serve URI")
    from ..practice import CONTROLLERS, LoggingChain, write_practice
    from ..practice.references import family_named
    from ..signals.controller import RESERVED
    from ..steps.named_methods import load_methods

    if options.out is None:
        raise UsageError("--out DIR is needed")
    if duration_s is not None and duration_s < SHORTEST_S:
        raise UsageError(f"--seconds: a path takes {SHORTEST_S:g} s at least")
    how: dict[str, Any] = {"families": tuple(map(family_named, families)) or None, "duration_s": duration_s}
    if speeds:
        how["speeds"] = speeds
    if controller is not None and (onboard := controller.removeprefix("onboard_")) in CONTROLLERS:
        how["controllers"] = (onboard,)
    elif controller is not None:
        own = load_methods("controllers", [controller])[0]
        if own.name in RESERVED:
            raise UsageError(f"--controller: {controller} is called {own.name!r}, which in recordings means what the "
                             f"onboard streams show; any name but {', '.join(RESERVED)} will do")
        how["controller"] = own
    chain = LoggingChain(offset_s=1e-3 * offset_ms, drift=1e-6 * drift_ppm, wander_sd_s=1e-3 * wander_ms)
    paths = write_practice(options.out, flights, options.seed, suffix=suffix, chain=chain,
                           progress=lambda done, n: options.say(f"{done} of {n} flown"), **how)
    close(options, f"{len(paths)} SYNTHETIC recording{'s' * (len(paths) != 1)} written to {options.out}",
          "what is in them", "nanobench", "audit", options.out)
    return options.finish("simulate", {"synthetic": True, "files": [path.name for path in paths]})
