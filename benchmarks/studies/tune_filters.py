"""Searches noise and drag of the inertial filters: every row by one objective, with one budget, on the same flights.

    python benchmarks/studies/tune_filters.py [--data DIR] [--row NAME ...] [--budget 450] [--write]

Objective: mean log density [nat] of the true position under the filter's own covariance. Half of it is among few noisy
poses (``aided``). The other half is 1, 5, 10 and 20 s after the last pose (``blackout``). Recordings are of the
families that train, so many of each session, all sessions counting alike. Every row starts from the same values and is
searched by L-BFGS over logarithms. Sessions held out in turn set the number of evaluations: the one after which the
sessions that were not searched on are likeliest. A last search over all of them goes so far. Other families have no
vote and are only printed. With --write what was found goes into the package.
"""

from __future__ import annotations

import argparse
import contextlib
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
from scipy.optimize import minimize

from nanobench_tools.auditing.usable import POSE
from nanobench_tools.errors import NanobenchError
from nanobench_tools.flight import Flight, Span, mask_of
from nanobench_tools.lookup.registry import load
from nanobench_tools.protocols import aided, blackout, task3
from nanobench_tools.protocols.sessions import labels_of
from nanobench_tools.settings import FOLDER
from nanobench_tools.sources.labels import FILTERS_SEARCHED_ON, family_of
from nanobench_tools.steps.options import Options

ROWS = {"strapdown": "error_state_ekf", "error_state_ekf": "error_state_ekf", "invariant_ekf": "invariant_ekf",
        "drag_ekf": "drag_ekf", "drag_matrix_ekf": "drag_ekf"}
"""Name of a row -> its module."""
FROM_SESSION = 5
"""Recordings of a session that are searched on, spread evenly over their names."""
WINDOWS = 2
"""Blackouts of a flight, spread evenly over it."""
EVERY_S = 0.1
"""Between the positions of ``aided`` that count."""
START = {
    "gyro_noise": 0.00236, "acc_noise": 0.011, "vertical_noise": 0.00374, "stamp": 0.0095, "drawn": 0.56,
    "gyro_walk": 5.5e-05, "acc_walk": 0.00132, "position_sd": 0.00109, "roll_pitch_sd": 0.009, "pitch_sd": 0.0262,
    "yaw_sd": 0.179, "mount_sd": 0.3, "mount_walk": 0.00136, "drag": 0.4, "drag_cross": 0.0, "drag_quadratic": 0.0,
    "drag_sd": 0.282, "air_sd": 0.00195, "air_s": 1.15, "slope_mean": 0.00085, "slope_sd": 0.0005, "late_sd": 0.0143,
    "wander_sd": 0.0033, "wander_s": 0.367, "acc_bias_sd": 0.1, "acc_bias_z_sd": 0.3, "lift_bias_sd": 0.0253,
    "start_tilt_sd": 0.1, "start_velocity_sd": 0.5, "gyro_bias_sd": 0.03, "tilt_s": 0.1,
}
"""Of an earlier search for ``drag_matrix_ekf``, on nine circles and trefoils."""
SPAN = 30.0
"""A setting is searched between its start divided and multiplied by this."""
STEP = 0.01
"""Of a derivative, as a share of the setting."""
SIGNED = {"slope_mean": 1e-3, "drag_cross": 0.02, "drag_quadratic": 0.02}
"""Settings that may be nought or negative, and the size of a step that matters."""
STOPS = 24
"""Numbers of evaluations after which a search may stop, evenly by their logarithm."""
WORST = -50.0
"""Log density of a position that is not to be had, or is less likely: one window must not rule."""


@dataclass(frozen=True)
class Seen:
    """What a filter is given, and the true positions (k, 3) m at times (k,) s that judge it."""

    given: Flight
    at_s: np.ndarray
    true_m: np.ndarray


def seen_of(case: task3.Case, seed: int) -> list[Seen]:
    """One of ``aided``, and the blackouts."""
    mocap = case.flight["mocap"]
    good = np.isfinite(mocap[POSE]).all(axis=1)
    truth_s, truth = mocap.time_s[good], mocap["px", "py", "pz"][good]

    def true(at_s: np.ndarray) -> np.ndarray:
        return np.stack([np.interp(at_s, truth_s, column) for column in truth.T], axis=1)

    grid = np.arange(case.spans[0].start_s, case.spans[-1].end_s, EVERY_S)
    grid = grid[mask_of(case.spans, grid)]
    found = [Seen(aided.given_to(case, aided.Aiding(), seed), grid, true(grid))]
    starts = blackout.starts(case)
    for t0 in starts[:: max(len(starts) // WINDOWS, 1)][:WINDOWS]:
        ends = np.array([t0 + h for h in blackout.HORIZONS_S
                         if any(s.start_s <= t0 and t0 + h <= s.end_s for s in case.spans)])
        until = Span(-np.inf, float(ends[-1]) + EVERY_S)
        found.append(Seen(blackout.given_until(case.flight, t0).during(until), ends, true(ends)))
    return found


def log_density(method: Any, one: Seen) -> float:
    """Mean over the times [nat] of the true position under the filter's own, at its nearest stamps."""
    made = method.estimate(one.given)
    row = np.clip(np.searchsorted(made.time_s, one.at_s), 1, len(made.time_s) - 1)
    row -= one.at_s - made.time_s[row - 1] < made.time_s[row] - one.at_s
    on = (one.at_s - made.time_s[row])[:, None]
    off = one.true_m - made.position_m[row] - on * made.velocity_m_s[row]
    cov = made.covariance[row, :3, :3]
    if not (np.isfinite(cov).all() and np.isfinite(off).all()):
        return WORST
    sign, volume = np.linalg.slogdet(cov)
    if not (sign > 0.0).all():
        return WORST
    squared = np.einsum("ni,ni->n", off, np.linalg.solve(cov, off[..., None])[..., 0])
    return float(np.mean(np.maximum(-0.5 * (squared + volume + 3.0 * math.log(2.0 * math.pi)), WORST)))


Flown = Sequence[Seen]
Sessions = Sequence[Sequence[Flown]]


def objective(method: Any, sessions: Sessions) -> float:
    """Mean over sessions of the mean over their flights [nat]."""
    return float(np.mean([np.mean([0.5 * log_density(method, first)
                                   + 0.5 * np.mean([log_density(method, one) for one in rest])
                                   for first, *rest in flights]) for flights in sessions]))


def usable(flight: Flown) -> bool:
    """Whether there is a blackout, and every row can be run."""
    try:
        for name in ROWS:
            load("estimators", name)().estimate(flight[0].given)
    except NanobenchError:
        return False
    return len(flight) > 1


def in_sessions(cases: Sequence[task3.Case]) -> list[list[task3.Case]]:
    """By session, the earliest first."""
    labels = labels_of([case.flight for case in cases])
    return [[case for case, one in zip(cases, labels, strict=True) if one == label] for label in np.unique(labels)]


def evenly(flights: Sequence[task3.Case], count: int) -> list[task3.Case]:
    """``count`` of them, or all, spread over their names."""
    ordered = sorted(flights, key=lambda case: case.flight.name)
    rows = np.unique(np.linspace(0, len(ordered) - 1, min(count, len(ordered))).round().astype(int))
    return [ordered[row] for row in rows]


@dataclass
class Search:
    """Of one row from ``start``, for at most ``budget`` evaluations of the objective. ``steps``: (evaluations,
    settings) of every value better than all before, the start first."""

    method: Any
    start: Mapping[str, float]
    sessions: Sessions
    budget: int
    tried: int = 0
    best: float = -math.inf
    steps: list[tuple[int, dict[str, float]]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.names = [name for name, value in self.start.items() if value != 0.0 or name in SIGNED]

    def settings(self, x: np.ndarray) -> dict[str, float]:
        """x: 0 is the start; logarithms of ratios, and for what may be negative, steps."""
        return {**self.start, **{name: self.start[name] + SIGNED[name] * value if name in SIGNED
                                 else self.start[name] * math.exp(value)
                                 for name, value in zip(self.names, x.tolist(), strict=True)}}

    def value(self, x: np.ndarray) -> float:
        """The objective, negative; StopIteration when the budget is used up."""
        if self.tried >= self.budget:
            raise StopIteration
        self.tried += 1
        self.method.settings = self.settings(x)
        found = objective(self.method, self.sessions)
        if found > self.best:
            self.best = found
            self.steps.append((self.tried, {key: float(f"{v:.4g}") for key, v in self.method.settings.items()}))
        return -found

    def both(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """The objective and its gradient by forward differences."""
        here = self.value(x)
        return here, np.array([(self.value(x + step) - here) / STEP for step in STEP * np.eye(len(x))])

    def run(self) -> Search:
        """Until the budget is used up, or no step makes it better."""
        limit = math.log(SPAN)
        with contextlib.suppress(StopIteration):
            minimize(self.both, np.zeros(len(self.names)), jac=True, method="L-BFGS-B",
                     bounds=[(-limit, limit)] * len(self.names))
        return self

    def after(self, evaluations: int) -> dict[str, float]:
        """The best settings by then."""
        return [settings for tried, settings in self.steps if tried <= evaluations][-1]


def searched(method: Any, start: Mapping[str, float], sessions: Sessions,
             budget: int) -> tuple[dict[str, float], list[tuple[int, float]], int]:
    """(settings, [(evaluations, mean objective of sessions held out in turn after so many)], evaluations used)."""
    folds = [(Search(method, start, [*sessions[:i], *sessions[i + 1:]], budget).run(), out)
             for i, out in enumerate(sessions)]
    grid = np.unique(np.geomspace(1, budget, STOPS).round().astype(int)).tolist()
    curve = []
    for evaluations in grid:
        found = []
        for search, out in folds:
            method.settings = search.after(evaluations)
            found.append(objective(method, [out]))
        curve.append((evaluations, float(np.mean(found))))
    stop = max(curve, key=lambda pair: pair[1])[0]
    whole = Search(method, start, sessions, stop).run()
    return whole.after(stop), curve, stop


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, action="append", default=[])
    parser.add_argument("--row", action="append", choices=ROWS)
    parser.add_argument("--budget", type=int, default=450, help="evaluations of the objective for each search")
    parser.add_argument("--seed", type=int, default=0, help="of the noise of the poses")
    parser.add_argument("--write", action="store_true")
    given = parser.parse_args()
    options = Options(data=tuple(given.data), quiet=True)
    flights = options.load()
    cases = task3.select(flights, options.audit(flights)[0], task3.BLACKOUT)
    seen = {case.flight.name: found for case in cases if usable(found := seen_of(case, given.seed))}
    cases = [case for case in cases if case.flight.name in seen]
    training = in_sessions([case for case in cases if family_of(case.flight) in FILTERS_SEARCHED_ON])
    if len(training) < 2:
        raise SystemExit("needs circles and trefoils of two sessions or more: each is held out in turn")
    chosen = [evenly(session, FROM_SESSION) for session in training]
    parts = {"searched on": chosen,
             "the rest of their families": [[c for c in session if c not in some]
                                            for session, some in zip(training, chosen, strict=True)],
             "other families": in_sessions([c for c in cases if family_of(c.flight) not in FILTERS_SEARCHED_ON])}
    given_to = {part: [[seen[c.flight.name] for c in session] for session in sessions if session]
                for part, sessions in parts.items()}
    print("log density of the true position [nat], mean over sessions, at the start -> as shipped -> found; "
          + ", ".join(f"{part}: n = {sum(map(len, s))} of {len(s)} sessions" for part, s in given_to.items()))
    results = {}
    for name in given.row or ROWS:
        began = time.process_time()
        method = load("estimators", name)()
        shipped_now = dict(method.settings)
        start = {key: START[key] if value or key in SIGNED else 0.0 for key, value in shipped_now.items()}
        found, curve, stop = searched(method, start, given_to["searched on"], given.budget)
        results[name] = found
        print(f"{name}: stopped after {stop} evaluations, {time.process_time() - began:.0f} s")
        print("   sessions held out in turn: " + ", ".join(f"{n}: {value:.3f}" for n, value in curve))
        for part, sessions in given_to.items():
            values = []
            for settings in (start, shipped_now, found):
                method.settings = settings
                values.append(f"{objective(method, sessions):.3f}")
            print(f"   {part}: {' -> '.join(values)}")
        print("   " + ", ".join(f"{key} {value:g}" for key, value in found.items()), flush=True)
    if given.write:
        write(results)


def write(results: Mapping[str, Mapping[str, float]]) -> None:
    """Into the package's settings; rows that were not searched stay."""
    file = FOLDER / "values" / "estimators.toml"
    text: Any = tomlkit.parse(file.read_text("utf-8"))
    for name, settings in results.items():
        text[ROWS[name]][name]["value"].update(settings)
    file.write_text(tomlkit.dumps(text), "utf-8")


if __name__ == "__main__":
    main()
