"""The "divergence" of the published fast flights: logged estimates whose log had ended, as a picture needs them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..audit import Audit
from ..faults.kinds import log_ended
from ..flight import mask_of as inside
from ..labels import speed_of
from .task3 import Case
from .usable import POSE

ROWS, MOST = 300, 6
STREAM = "estimator"


def dead_logs(cases: Sequence[Case], audits: Mapping[str, Audit]) -> list[dict[str, Any]]:
    """[{flight, speed, t_s, error_m, dead: [[start, end] s], live_rmse_m, all_rmse_m}]: distance between the logged
    position and motion capture, as recorded, over the rows that the published protocol scores; the MOST flights that
    dead rows make worst. Only flights whose estimator stream the audit found dead there."""
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
        found.append({"flight": flight.name, "speed": speed_of(flight), "t_s": np.round(time_s[thin], 3).tolist(),
                      "error_m": np.round(away[thin], 4).tolist(),
                      "dead": [[max(s.start_s, time_s[0]), min(s.end_s, time_s[-1])] for s in dead
                               if s.end_s > time_s[0] and s.start_s < time_s[-1]],
                      "live_rmse_m": float(np.sqrt(np.mean(away[live] ** 2))) if live.any() else None,
                      "all_rmse_m": float(np.sqrt(np.mean(away**2)))})
    return sorted(found, key=lambda one: -one["all_rmse_m"])[:MOST]
