"""What the audit says of every stream's clock, the moving error included."""

from __future__ import annotations

from dataclasses import replace

from ..clock.reading import ClockReading
from ..clock.readings import read_clocks
from ..signals.context import Context
from .confirm import believed


def clocks_with_warp(context: Context) -> dict[str, ClockReading]:
    """The constant readings of every stream; those on the vehicle's one clock also say how its error moves, if it
    does and other streams confirm it."""
    readings = context.once(read_clocks)
    if not any(reading.identifiable for reading in readings.values()):
        return readings
    warp = context.once(believed)
    if warp is None or not warp.moving:
        return readings
    points = warp.points()
    moving = {name: replace(reading, wander_sd_s=warp.wander_sd_s, warp=points, evidence=warp.evidence)
              for name, reading in readings.items() if shares_clock(name, reading)}
    return {**readings, **moving}


def shares_clock(name: str, reading: ClockReading) -> bool:
    """Whether a stream was found to have the gyro's clock."""
    return reading.identifiable and (name == "imu" or reading.reason.startswith("clock of the gyro"))
