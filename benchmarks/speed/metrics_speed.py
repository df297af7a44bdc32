"""ATE and RTE of one 42 s flight against evo on the same arrays: the ratio of times, and that the numbers agree.

    python benchmarks/speed/metrics_speed.py [--data PATH]

evo gets its fastest way: consecutive pairs 1 m apart, translation only. Ours takes a start every 10 rows, in the
start's frame, about ten times as many pairs. Best of several repeats, one thread.
"""

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from evo import __version__ as evo_version
from evo.core import metrics as evo_metrics
from evo.core.trajectory import PoseTrajectory3D
from evo.core.units import Unit
from kept import show

from nanobench_tools import so3
from nanobench_tools.metrics import trajectory
from nanobench_tools.sources.discover import default_data, load_recordings

ROWS = 4226
REQUIRED_RATIO = 20.0

Arrays = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def flight_arrays(places: list[Path] | None) -> tuple[Arrays, str]:
    """(time, truth position, truth quaternion, estimate, its quaternion) of a recording of 42 s, else made up."""
    for flight in load_recordings(places).flights if places else []:
        mocap = flight["mocap"]
        if "estimator" in flight and "attitude_qw" in flight and abs(len(mocap) - ROWS) < 20:
            truth_q, quaternion = (q / np.linalg.norm(q, axis=1, keepdims=True) for q in (
                mocap["qx", "qy", "qz", "qw"], flight["attitude_qw"]["qx", "qy", "qz", "qw"]))
            return (mocap.time_s, mocap["px", "py", "pz"], truth_q, flight["estimator"]["x", "y", "z"],
                    quaternion), f"recording {flight.name}, {len(mocap)} rows"
    rng, t = np.random.default_rng(0), np.arange(ROWS) * 0.01
    truth = np.stack([np.sin(0.8 * t), np.sin(1.6 * t), 1.0 + 0.1 * np.sin(t)], axis=1)
    quaternion = so3.exp(0.2 * np.stack([np.sin(t), np.cos(t), 0.3 * t], axis=1))
    noise = so3.exp(0.01 * rng.normal(size=(ROWS, 3)))
    return (t, truth, quaternion, truth + 0.02 * rng.normal(size=(ROWS, 3)), so3.multiply(quaternion, noise)), \
        f"SYNTHETIC path, {ROWS} rows"


def ours(arrays: Arrays) -> tuple[float, float]:
    _, truth, truth_q, estimate, estimate_q = arrays
    return trajectory.ate(estimate, truth).rmse_m, trajectory.rte(estimate, estimate_q, truth, truth_q)


def theirs(arrays: Arrays) -> tuple[float, list[tuple[int, int]], np.ndarray]:
    """(ATE RMSE, pairs, relative errors)."""
    t, truth, truth_q, estimate, estimate_q = arrays
    reference = PoseTrajectory3D(truth, np.roll(truth_q, 1, axis=1), t)
    other = PoseTrajectory3D(estimate.copy(), np.roll(estimate_q, 1, axis=1), t)
    rpe = evo_metrics.RPE(evo_metrics.PoseRelation.translation_part, 1.0, Unit.meters)
    rpe.process_data((reference, other))
    other.align(reference)
    ape = evo_metrics.APE(evo_metrics.PoseRelation.translation_part)
    ape.process_data((reference, other))
    ends = list(rpe.delta_ids)
    return ape.get_statistic(evo_metrics.StatisticsType.rmse), list(zip([0, *ends[:-1]], ends, strict=True)), rpe.error


def best_time(function: Callable, arrays: Arrays, repeats: int) -> float:
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        function(arrays)
        times.append(time.perf_counter() - start)
    return min(times)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, action="append")
    options = parser.parse_args()
    arrays, what = flight_arrays(options.data or default_data())
    ate_m, _ = ours(arrays)
    evo_ate_m, pairs, evo_errors = theirs(arrays)
    starts, ends = np.array(pairs).T
    errors = trajectory.relative_errors(arrays[3], arrays[4], arrays[1], arrays[2], starts, ends)[0]
    difference = max(abs(ate_m - evo_ate_m), float(np.max(np.abs(errors - evo_errors))))
    mine, evo = best_time(ours, arrays, 50), best_time(theirs, arrays, 5)
    print(f"{what}\nATE and RTE: nanobench {1e3 * mine:.2f} ms, evo {evo_version.lstrip('v')} {1e3 * evo:.1f} ms, "
          f"ratio {evo / mine:.0f} (required {REQUIRED_RATIO:.0f}); largest difference on the same pairs "
          f"{difference:.1e} m")
    show("evo / nanobench, ATE and RTE", evo / mine, 5, REQUIRED_RATIO)
    return 0 if evo / mine >= REQUIRED_RATIO and difference < 1e-9 else 1


if __name__ == "__main__":
    raise SystemExit(main())
