"""Requests for flights from the options of ``fly`` that hold for every one of them, and the question before arming."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ...errors import UsageError
from ...steps.options import Options
from ..record import toc_cache

if TYPE_CHECKING:
    from ...practice.references import PathSpec
    from ...radio.fly.pilot import Pilot
    from ...radio.fly.prepare import Ready
    from ...radio.fly.safety import Limits
    from ...radio.fly.session import Request


@dataclass(frozen=True)
class FlightOptions:
    """``blocks``: file with the log blocks of the recording; ``yes``: do not ask before arming."""

    limits: Limits
    record_to: Path | None
    blocks: Path | None
    yaw_deg: float
    check_motors: bool
    yes: bool

    def request(self, options: Options, spec: PathSpec, pilot: Pilot, uri: str, mocap: str, **more: Any) -> Request:
        """A request; ``more`` replaces its other fields. Raises UsageError, InputError."""
        from ...radio.blocks import default_blocks, read_blocks
        from ...radio.fly.session import Request, is_simulated
        from ...radio.mocap.mocap_sources import pose_source

        source = pose_source(mocap, uri)
        simulated = is_simulated(uri, source)
        given: dict[str, Any] = {
            "yaw_rad": math.radians(self.yaw_deg), "record_to": self.record_to, "quiet": options.quiet,
            "say": options.say, "cache": toc_cache(), "check_motors": self.check_motors,
            "motor_tests": None if simulated else motor_tests()}
        if "confirm" not in more:
            given["confirm"] = confirmation(uri, simulated, self.yes)
        return Request(spec, pilot, self.limits, uri, source,
                       read_blocks(self.blocks) if self.blocks else default_blocks(), **{**given, **more})


def motor_tests() -> Path | None:
    """File with earlier motor tests of the user's vehicles; None where nothing can be written."""
    folder = toc_cache()
    return None if folder is None else folder / "motor_tests.json"


def confirmation(uri: str, simulated: bool, yes: bool) -> Callable[[Ready | None], None]:
    """Returns the call before a vehicle is armed: it waits for Enter if the vehicle is real. Raises UsageError without
    a terminal, before a link is opened."""
    if simulated or yes:
        return lambda ready: None
    if not sys.stdin.isatty():
        raise UsageError(f"--uri {uri}: there is no terminal to confirm that the motors may turn; give --yes")

    def ask(ready: Ready | None) -> None:
        click.echo("ready: Enter arms and takes off, Ctrl-C ends. In flight Ctrl-C lands; space or a second Ctrl-C "
                   "stops the motors", err=True)
        try:
            input()
        except (KeyboardInterrupt, EOFError):
            raise UsageError("not confirmed; not armed") from None

    return ask


def refuse_given(option: str, *names: str) -> None:
    """UsageError if one of the options ``names`` was given in addition to ``option``, whose file has it."""
    context = click.get_current_context()
    for found in context.command.params:
        source = context.get_parameter_source(found.name or "")
        if found.name in names and source not in (None, click.core.ParameterSource.DEFAULT):
            raise UsageError(f"{found.opts[0]} does not go with {option}: its file describes the flights")
