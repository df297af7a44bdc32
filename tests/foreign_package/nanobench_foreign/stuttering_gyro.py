"""stuttering_gyro: the gyro's first axis swings between two values from row to row.

Found where its steps change their sign 20 times in a row and are all larger than 50 rad/s, which no vehicle does.

Size: the mean step, rad/s. Smallest found: 50 rad/s over 20 rows.
"""

import numpy as np

from nanobench_tools import Fault, Flight
from nanobench_tools.auditing.faults.kind import Blind, FaultKind, Injection

KIND, STEP_RAD_S, ROWS = "stuttering_gyro", 50.0, 20


def find(flight, context) -> list[Fault]:
    """One fault from the first to the last of the rows that swing."""
    if "imu" not in flight or "gyro_x" not in flight["imu"]:
        return []
    imu = flight["imu"]
    step = np.diff(imu["gyro_x"])
    swings = (np.abs(step[1:]) > STEP_RAD_S) & (np.abs(step[:-1]) > STEP_RAD_S) & (step[1:] * step[:-1] < 0.0)
    rows = np.flatnonzero(swings)
    if len(rows) < ROWS:
        return []
    start, end = float(imu.time_s[rows[0]]), float(imu.time_s[rows[-1] + 2])
    size = float(np.abs(step[rows]).mean())
    return [Fault(KIND, "imu", (imu.columns[imu.index("gyro_x")],), start, end, size, "rad/s",
                  f"{len(rows)} rows in which the gyro swings between two values", STEP_RAD_S)]


def stutter(flight: Flight, rng, size: float, at_s: float | None = None) -> tuple[Flight, Fault]:
    """One second in which every other row of the gyro is ``size`` rad/s too high."""
    from dataclasses import replace

    imu = flight["imu"]
    at = at_s if at_s is not None else float(rng.uniform(0.4, 0.6)) * float(imu.time_s[-1])
    rows = np.flatnonzero((imu.time_s >= at) & (imu.time_s < at + 1.0))
    values = imu.values.copy()
    values[rows[::2], imu.index("gyro_x")] += size
    truth = Fault(KIND, "imu", (imu.columns[imu.index("gyro_x")],), float(imu.time_s[rows[0]]),
                  float(imu.time_s[rows[-1]]), size, "rad/s", "swings put in")
    return flight.with_streams(imu=replace(imu, values=values)), truth


FAULT = FaultKind(KIND, find, __doc__, group="value", cuts=True,
                  injection=Injection(stutter, (60.0, 200.0), "rad/s", blind=(Blind(200.0, {}, everywhere=True),)))
