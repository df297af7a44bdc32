"""The "divergence" of the published fast flights: logged estimates whose log had ended, as a picture needs them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..auditing.faults.kinds import log_ended
from ..auditing.recording_audit import Audit
from ..auditing.usable import POSE
from ..flight import mask_of as inside
from ..results.result import Result
from ..sources.labels import speed_of
from .task3 import Case

ROWS, MOST = 300, 6
STREAM = "estimator"


@dataclass(frozen=True, repr=False)
class DeadLog(Result):
    """Distance (k,) m between the logged position and motion capture at t_s (k,), as recorded; ``dead``: (start, end) s
    of rows after the log had ended; RMS without and with these."""

    flight: str
    speed: str | None
    t_s: np.ndarray
    error_m: np.ndarray
    dead: Sequence[tuple[float, float]]
    live_rmse_m: float | None
    all_rmse_m: float


def dead_logs(cases: Sequence[Case], audits: Mapping[str, Audit]) -> list[DeadLog]:
    """Over the rows that the published protocol scores, the MOST flights that dead rows make worst. Only flights whose
    estimator stream the audit found dead there."""
    found = []
    for case in cases:
        flight, audit = case.flight, audits[case.flight.name]
        dead = [fault.span for fault in audit.faults if fault.kind in log_ended() and fault.stream == STREAM]
        mocap, estimator = flight["mocap"], flight["estimator"]
        good = np.isfinite(mocap[POSE]).all(axis=1)
        rows = np.flatnonzero(inside(case.spans, estimator.time_s) & np.isfinite(estimator["x", "y", "z"]).all(axis=1))
        if not dead or not len(rows) or not inside(dead, estimator.time_s[rows]).any():
            continue
        time_s = estimator.time_s[rows]
        truth = np.stack([np.interp(time_s, mocap.time_s[good], mocap[name][good]) for name in ("px", "py", "pz")], 1)
        away = np.linalg.norm(estimator["x", "y", "z"][rows] - truth, axis=1)
        live = ~inside(dead, time_s)
        thin = np.unique(np.linspace(0, len(rows) - 1, ROWS).astype(int))
        found.append(DeadLog(flight.name, speed_of(flight), np.round(time_s[thin], 3), np.round(away[thin], 4),
                             [(max(s.start_s, time_s[0]), min(s.end_s, time_s[-1])) for s in dead
                              if s.end_s > time_s[0] and s.start_s < time_s[-1]],
                             float(np.sqrt(np.mean(away[live] ** 2))) if live.any() else None,
                             float(np.sqrt(np.mean(away**2)))))
    return sorted(found, key=lambda one: -one.all_rmse_m)[:MOST]
