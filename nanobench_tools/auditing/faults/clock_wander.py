"""clock_wander: the time error of a stream moves within the flight, beyond a constant and a line.

Found in two ways. By scatter that noise does not explain (``drift_and_wander``). It compares half-second lags of gyro
and attitude with a placebo fit of the same spectrum. The estimated position's error along its path is compared with
that across. And by the error itself, row by row (``moving.infer``), where streams that did not set it confirm it. In
the published recordings the link's clock wanders by 33 ms in steps of tenths of a second, for all streams alike. Half
seconds average part of that out, so the size is that of the error row by row if there is one. The wander over time is
in the clock of the stream (``time_offset``).

Size: standard deviation in s. Smallest found: stated per stream; 4 ms on the track. From the gyro alone it is 4-20 ms
when the clock moves over seconds, up to 90 ms when it moves over tenths.
"""

from ...flight import Fault, Flight
from ...signals.context import Context
from ...time_offsets.constant.drift_and_wander import moving_clocks
from ...time_offsets.constant.readings import read_clocks
from ...time_offsets.mathematics.steadiness import SMALLEST_WANDER_S
from ...time_offsets.moving.confirm import believed
from ...time_offsets.moving.moving_readings import shares_clock
from .kind import FaultKind
from .making import over_stream

KIND = "clock_wander"


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per stream."""
    readings = context.once(read_clocks)
    known = context.once(moving_clocks)
    shared = {name for name, reading in readings.items() if shares_clock(name, reading)}
    time_offset = context.once(believed) if shared else None
    faults = []
    for name in readings:
        clock = known.get(name)
        wanders, evidence, size = False, "", 0.0
        if clock is not None and clock.wanders:
            wanders, evidence, size = True, clock.wander_evidence, clock.wander_sd_s
        if name in shared and time_offset is not None and time_offset.moving and (
                time_offset.wander_sd_s > SMALLEST_WANDER_S):
            wanders, size = True, time_offset.wander_sd_s
            evidence = f"the clock {time_offset.reason}" + (f"; {evidence}" if evidence else "")
        if wanders:
            smallest = SMALLEST_WANDER_S if clock is None else clock.detectable_wander_s
            faults.append(over_stream(KIND, flight, name, None, size, "s", evidence, smallest))
    return faults


FAULT = FaultKind(KIND, find, __doc__,
                  told="the clock of {streams} moves by {size} (SD)",
                  advice="try --clock retimed",
                  group="clock", corrected=True, whole=True,
                  injection="nanobench_tools.practice.inject.clock_faults:CLOCK_WANDER")
