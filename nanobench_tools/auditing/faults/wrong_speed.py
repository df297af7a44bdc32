"""wrong_speed: a rotor speed sensor that misses pulses or reads nothing while its motor runs.

Found where the speed of one motor is less than two thirds of the others' although its command equals theirs within 15
%. Thrust goes with the square, and a vehicle with one motor at less than half of it would fall over. An optical sensor
that misses one blade of two reads half, one that lost its light reads nothing. Rows are averaged over 0.1 s, longer
than motors take to follow. Thrust per squared speed read from such a log is too large.

Size: share of the rows. Smallest found: 0.3 s in all. Not found: two sensors or more that fail alike.
"""

import numpy as np
from scipy.ndimage import uniform_filter1d

from ...flight import Fault, Flight, motors_of
from ...settings import count, number
from ...signals.context import Context
from ...signals.usable_rows import usable_streams
from .kind import FaultKind

KIND = "wrong_speed"

FEWEST = count("audit.wrong_speed.fewest")
LESS = number("audit.wrong_speed.less")
ALIKE = number("audit.wrong_speed.alike")
RUNS = number("audit.wrong_speed.runs")
MEAN_S = number("audit.wrong_speed.mean_s")
LEAST_S = number("audit.wrong_speed.least_s")


def find(flight: Flight, context: Context) -> list[Fault]:
    """At most one fault per motor."""
    streams = context.once(usable_streams)
    if any(name not in streams for name in ("rpm", "motor")):
        return []
    rpm, motors = streams["rpm"], motors_of(streams["motor"])
    if len(motors) < FEWEST or motors_of(rpm) != motors:
        return []
    t = rpm.time_s
    if len(t) < 10 or len(streams["motor"]) < 2:
        return []
    step = max(float(np.median(np.diff(t))), 1e-6)
    wide = max(round(MEAN_S / step), 1)
    speed = np.abs(np.nan_to_num(rpm[motors]))
    command = np.nan_to_num(streams["motor"].interpolate(motors, t))
    mean, commanded = (uniform_filter1d(x, wide, axis=0, mode="nearest") for x in (speed, command))
    faults = []
    for k, name in enumerate(motors):
        others = [i for i in range(len(motors)) if i != k]
        usual, alike = np.median(mean[:, others], axis=1), np.median(commanded[:, others], axis=1)
        runs = (commanded[:, k] > RUNS) & (commanded[:, k] > ALIKE * alike) & (usual > 0.0)
        bad = runs & (mean[:, k] < LESS * usual)
        if bad.sum() * step < LEAST_S:
            continue
        rows = np.flatnonzero(bad)
        share = float(bad.sum() / max(runs.sum(), 1))
        nothing = float((speed[bad, k] == 0.0).mean())
        reads = speed[bad & (speed[:, k] > 0.0), k] / usual[bad & (speed[:, k] > 0.0)]
        text = f"nothing in {nothing:.0%} of them" if nothing else "always something"
        text += f", else {np.median(reads):.2f} of the others' speed" if len(reads) else ""
        faults.append(Fault(KIND, "rpm", (rpm.columns[rpm.index(name)],), float(t[rows[0]]), float(t[rows[-1]]), share,
                            "1", f"{rpm.columns[rpm.index(name)]} is too low for its command in {share:.0%} of the "
                            f"rows: {text}; thrust per squared speed from this log is wrong",
                            LEAST_S / max(float(t[-1] - t[0]), LEAST_S)))
    return faults


FAULT = FaultKind(KIND, find, __doc__,
                  told="rotor speeds ({columns}) miss pulses",
                  advice="do not fit thrust to these speeds")
