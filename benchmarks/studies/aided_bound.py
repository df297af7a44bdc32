"""What bounds the error among few, late, noisy poses: what the filters say of themselves, and the clock's share.

python benchmarks/studies/aided_bound.py [--data DIR]

10 Hz poses, 30 ms late, 1 cm (protocol ``aided``). Per clock: mean ATE and the RMS of the estimators' own covariances.
Where both agree, the error comes from the noise of IMU and timestamps, and only less noise would lower it. Last, by
the noise of the acceleration, the least error of any causal estimate and of any that looks ahead. The causal one
solves the steady Riccati equation of position and velocity along one axis, three axes alike.
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.linalg import expm, solve_discrete_are, solve_discrete_lyapunov

from estimators.drag_ekf import DragEkf
from estimators.error_state_ekf import ErrorStateEkf
from nanobench_tools.auditing.selection import distinct
from nanobench_tools.errors import NanobenchError
from nanobench_tools.methods import Estimate, Estimator
from nanobench_tools.metrics.statistics import bootstrap_interval
from nanobench_tools.protocols import aided, task3
from nanobench_tools.protocols.sessions import labels_of
from nanobench_tools.steps.options import Options

AIDING = aided.Aiding()
NOISES = (0.01, 0.02, 0.05, 0.1, 0.2)
"""m/s^2 per root Hz."""


class Kept:
    """Passes on and keeps what an estimator gave."""

    def __init__(self, method: Estimator) -> None:
        self.method, self.name, self.causal = method, method.name, method.causal
        self.made: Estimate | None = None

    def estimate(self, flight):
        self.made = self.method.estimate(flight)
        return self.made


def line(label: str, cases: Sequence[task3.Case], method: Estimator) -> None:
    """ATE and the stated RMS over the scored rows, means over flights, mm."""
    found, stated, scored = [], [], []
    for case in cases:
        kept = Kept(method)
        try:
            found.append(aided.score(case, kept, AIDING).metrics["ate_rmse_m"])
        except NanobenchError:
            continue
        rows = task3.inside(case.spans, kept.made.time_s)
        stated.append(np.sqrt(np.mean(np.trace(kept.made.covariance[rows, :3, :3], axis1=1, axis2=2))))
        scored.append(case.flight)
    low, high = bootstrap_interval(found, sessions=labels_of(scored)) or (np.nan, np.nan)
    print(f"{label:34s} {method.name:26s} n {len(found):3d}  ATE {1e3 * np.mean(found):5.1f} "
          f"[{1e3 * low:.1f}, {1e3 * high:.1f}] mm  stated {1e3 * np.mean(stated):5.1f} mm")


def riccati(density: float) -> tuple[float, float]:
    """Least RMS of three axes [m] for white noise of the acceleration of this density [m/s^2 per root Hz]. Once causal
    (over the delay and the time to the next pose), once looking ahead."""
    step = 1.0 / AIDING.rate_hz
    a, h = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[1.0, 0.0]])

    def moved(dt: float) -> tuple[np.ndarray, np.ndarray]:
        return expm(a * dt), density**2 * np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]])

    f, q = moved(step)
    ahead = solve_discrete_are(f.T, h.T, q, np.array([[AIDING.noise_m**2]]))
    gain = ahead @ h.T / (ahead[0, 0] + AIDING.noise_m**2)
    known = ahead - gain @ h @ ahead
    waits = AIDING.delay_s + np.linspace(0.0, step, 20, endpoint=False)
    causal = np.mean([(g @ known @ g.T + w)[0, 0] for g, w in map(moved, waits)])
    back = known @ f.T @ np.linalg.inv(ahead)  # Rauch-Tung-Striebel: S = P + G (S - P-) G^T
    smoothed = solve_discrete_lyapunov(back, known - back @ ahead @ back.T)
    return float(np.sqrt(3.0 * causal)), float(np.sqrt(3.0 * smoothed[0, 0]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, action="append", default=[])
    parser.add_argument("--batch", action="store_true", help="gtsam_batch too")
    arguments = parser.parse_args()
    options = Options(data=tuple(arguments.data))
    flights = options.load()
    audits, _ = options.audit(flights)
    seen = replace(options, clock="retimed").see_on_clock(distinct(flights)[0], audits, ("position", "velocity"))
    methods: list[Estimator] = [DragEkf(), ErrorStateEkf()]
    if arguments.batch:
        from estimators.gtsam.batch import GtsamBatch

        methods.append(GtsamBatch())
    for label, cases in (("real, as recorded", task3.select(flights, audits, "clean")),
                         ("real, re-timed", task3.select(seen.flights, seen.audits, "clean"))):
        for method in methods:
            line(label, cases, method)
    print("white noise of the acceleration -> least RMS of any estimate, causal | looking ahead [mm]")
    for density in NOISES:
        causal, smoothed = riccati(density)
        print(f"  {density:5.2f} m/s^2/sqrt(Hz) -> {1e3 * causal:5.1f} | {1e3 * smoothed:5.1f}")


if __name__ == "__main__":
    main()
