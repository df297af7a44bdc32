"""What the audit says of every stream's clock, the moving error included."""

from dataclasses import replace

from ...signals.context import Context
from ..constant.reading import ClockReading
from ..constant.readings import read_clocks
from .confirm import believed


def clocks_with_time_offset(context: Context) -> dict[str, ClockReading]:
    """The constant readings of every stream. Those on the vehicle's one clock also describe how its error moves, if it
    does and other streams confirm it."""
    readings = context.once(read_clocks)
    if not any(reading.identifiable for reading in readings.values()):
        return readings
    time_offset = context.once(believed)
    if time_offset is None or not time_offset.moving:
        return readings
    points = time_offset.points()
    moving = {name: replace(reading, wander_sd_s=time_offset.wander_sd_s, warp=points, evidence=time_offset.evidence)
              for name, reading in readings.items() if shares_clock(name, reading)}
    return {**readings, **moving}


def shares_clock(name: str, reading: ClockReading) -> bool:
    """Whether a stream was found to have the gyro's clock."""
    return reading.identifiable and (name == "imu" or reading.reason.startswith("clock of the gyro"))
