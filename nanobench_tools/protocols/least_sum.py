"""The least that a published row of Task 1 can have summed up to over h = 1..H, from the horizons it does print."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import coo_array

from ..settings import number

STEP_S = 0.01
MARGIN = number("tasks.least_sum.margin")
"""By how much means over one set of starts may differ from means over the same starts some steps later. The printed
errors of position break e(10) <= 10 e(1) by 2 %."""


def least_sum(by_horizon: Mapping[str, float], held: bool = False, turning_rad_s: float | None = None) -> float:
    """Smallest e(1) + .. + e(H) of mean errors e that never shrink with the horizon and have the printed values.

    ``held``: the row predicts that nothing changes, so that its errors are changes of the truth, and a change over
    a + b steps is at most one over a steps and one over the next b: e(a + b) <= e(a) + e(b). ``turning_rad_s``: the row
    predicts attitude by holding the rate, whose own mean error grows to this by H. Predicting b steps anew from a rate
    that is w off differs by at most b STEP_S w (rotations do not stretch), so that e(a + b) <= e(a) + e(b) +
    min(a, b) STEP_S w. Both take means over starts a steps later for means over the starts: MARGIN is for that.

    >>> least_sum({"1": 1.0, "3": 5.0})  # 1 + 1 + 5
    7.0
    >>> round(least_sum({"1": 1.0, "3": 3.0}, held=True), 3)  # e(2) is at least 3 / 1.05 - 1
    5.857
    """
    known = {int(h): error for h, error in by_horizon.items()}
    last = max(known)
    rows, limits = [], []  # (row, e(row[k]) with sign) <= limit
    for h in range(1, last):
        rows.append({h: 1.0, h + 1: -1.0})
        limits.append(0.0)
    if held or turning_rad_s is not None:
        slack = 0.0 if turning_rad_s is None else STEP_S * turning_rad_s
        for a in range(1, last // 2 + 1):
            for b in range(a, last - a + 1):
                rows.append({a + b: 1.0 / (1.0 + MARGIN), a: -2.0 if a == b else -1.0} | ({} if a == b else {b: -1.0}))
                limits.append(a * slack)
    entries = [(i, h - 1, factor) for i, row in enumerate(rows) for h, factor in row.items()]
    at, column, value = (np.array(part) for part in zip(*entries, strict=True))
    bounds = [(known.get(h, 0.0), known.get(h)) for h in range(1, last + 1)]
    found = linprog(np.ones(last), A_ub=coo_array((value, (at, column)), shape=(len(rows), last)).tocsr(),
                    b_ub=limits, bounds=bounds, method="highs")
    if not found.success:
        raise ValueError(f"errors {dict(by_horizon)} cannot be those of one row: {found.message}")
    return float(found.fun)
