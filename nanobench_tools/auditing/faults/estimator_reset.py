"""estimator_reset: the estimated position jumps although the vehicle did not.

Found by the step of (estimate - motion capture) from the medians of five rows before to five rows after. The link's
clock makes steps too, but only along the path. There the limit is 0.1 m + 0.2 s times the speed (clocks jump by up to
0.1-0.2 s). Across the path it is 0.08 m (a turning path bends away by a centimetre or two in 0.1 s). Without motion
capture the step of the estimate itself is taken beyond the path that its own velocity explains, with a limit of 0.3 m.
One entry per jump; the span runs until the error is back below a third of the jump, 2 s at most.

Size: metres. Smallest found in any direction: 1.3 times the root of the sum of both limits squared, 0.28 m at 0.5 m/s.
"""

import numpy as np

from ...flight import Fault, Flight
from ...settings import count, number
from ...signals.context import Context
from ...signals.dropouts import alive_until
from ...signals.mocap_derivatives import derivatives_of
from ...signals.paired_signals import on_grid
from ...signals.spikes import spikes
from ...signals.usable_rows import usable_streams
from ...signals.wrong_matches import wrong_matches
from .kind import FaultKind

KIND = "estimator_reset"

ALONG_M = number("audit.estimator_reset.along_m")
ALONG_S = number("audit.estimator_reset.along_s")
ACROSS_M = number("audit.estimator_reset.across_m")
ALONE_M = number("audit.estimator_reset.alone_m")
SURELY = number("audit.estimator_reset.surely")
ROWS = count("audit.estimator_reset.rows")
LONGEST_S = number("audit.estimator_reset.longest_s")
POSITION, VELOCITY = ("x", "y", "z"), ("vx", "vy", "vz")
TIMES_USUAL = number("audit.estimator_reset.times_usual")
AROUND_S = number("audit.estimator_reset.around_s")


def find(flight: Flight, context: Context) -> list[Fault]:
    """One fault per jump of the estimated position."""
    stream = context.once(usable_streams).get("estimator")
    if stream is None or not all(q in stream.quantities for q in POSITION):
        return []
    if any(v.stream in ("estimator", "mocap") for v in context.once(wrong_matches)):
        return []  # in other units or axes nothing fits anyway
    truth = context.once(derivatives_of)
    placed = on_grid(context, "estimator", POSITION) if truth is not None else None
    if placed is not None and truth is not None:
        t, error = truth.time_s, placed[0] - truth.position_m
        velocity, use = truth.velocity_m_s, placed[1] & truth.good
    elif all(q in stream.quantities for q in VELOCITY) and len(stream) > 4 * ROWS:
        use = np.isfinite(stream.values).all(axis=1) & (stream.time_s <= context.once(alive_until)["estimator"])
        t, v = stream.time_s, np.nan_to_num(stream[VELOCITY])
        travelled = np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t)[:, None], axis=0)])
        error, velocity = np.nan_to_num(stream[POSITION]) - travelled, v
    else:
        return []
    if len(t) < 4 * ROWS:
        return []
    for name, *_, first, last in context.once(spikes):
        if name == "estimator":
            use = use & ~((t > stream.time_s[first] - AROUND_S) & (t < stream.time_s[last] + AROUND_S))
    windows = np.median(np.lib.stride_tricks.sliding_window_view(error, ROWS, axis=0),
                        axis=-1)  # row j: j .. j + ROWS - 1
    before, after = windows[:-ROWS], windows[ROWS:]
    at = np.arange(ROWS - 1, ROWS - 1 + len(before))  # last row before the jump
    jump = after - before
    step, speed = np.linalg.norm(jump, axis=1), np.linalg.norm(velocity, axis=1)
    path = velocity[at] / np.maximum(speed[at], 1e-9)[:, None]
    along = np.sum(jump * path, axis=1)
    across = np.linalg.norm(jump - along[:, None] * path, axis=1)
    least = (ALONG_M, ACROSS_M) if placed is not None else (ALONE_M, ALONE_M)
    along_limit = least[0] + ALONG_S * speed[at]
    limit = np.full(len(step), max(least[1], TIMES_USUAL * float(np.median(step))))
    beyond = (
        ((np.abs(along) > along_limit) | (across > limit))
        & (step > limit)
        & use[at]
        & use[np.minimum(at + ROWS, len(use) - 1)]
    )
    rows = np.flatnonzero(beyond)
    faults: list[Fault] = []
    for group in np.split(rows, np.flatnonzero(np.diff(rows) > 2 * ROWS) + 1) if len(rows) else []:
        k = int(group[np.argmax(step[group])])
        start = float(t[at[k]])
        if faults and start < faults[-1].end_s:
            continue  # the way back of the one before
        later = np.linalg.norm(error[at[k] + 1 :] - before[k], axis=1) < step[k] / 3.0
        back = at[k] + 1 + int(np.argmax(later)) if later.any() else len(t) - 1
        faults.append(
            Fault(KIND, "estimator", tuple(stream.columns[stream.index(q)] for q in POSITION), start,
                  float(min(t[back], start + LONGEST_S)), float(step[k]), "m",
                  f"the estimated position jumps by {step[k]:.2f} m at {start:.2f} s at {speed[at[k]]:.2f} m/s",
                  float(SURELY * np.hypot(along_limit[k], limit[k])))
        )
    return faults


FAULT = FaultKind(KIND, find, __doc__,
                  told="the onboard estimate jumps {count}, by {size}",
                  advice="restart the estimator before flying; the jumps are scored",
                  group="flight", cuts=True, cuts_logs=False, cuts_trim=False,
                  injection="nanobench_tools.practice.inject.whole:ESTIMATOR_RESET")
