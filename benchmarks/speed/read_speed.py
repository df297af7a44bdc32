"""How fast all recordings are read: cold, from the cache, and by a plain reader of the same files in the same run.

    python benchmarks/speed/read_speed.py [--data DIR] [--jobs 2] [--repeat 3]

The plain reader unpacks every CSV and turns it into one array with ``numpy.loadtxt``, which supports no units, sheets
or broken files. A second one uses the csv module and ``float``. Cold means an empty cache folder; the operating system
may hold the files in memory for all readers alike.
"""

import argparse
import csv
import io
import json
import lzma
import os
import platform
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from kept import show

from nanobench_tools.sources import default_data, find_recordings, load_recordings


def seconds(run: Callable[[], object]) -> tuple[float, float]:
    """Wall clock and processor time [s]; the second says what a busy machine hides in the first."""
    start, start_cpu = time.perf_counter(), time.process_time()
    run()
    return time.perf_counter() - start, time.process_time() - start_cpu


def unpacked(path: Path) -> str:
    stored = path.read_bytes()
    return (lzma.decompress(stored) if path.suffix == ".xz" else stored).decode()


def with_loadtxt(paths: list[Path]) -> None:
    for path in paths:
        np.loadtxt(io.StringIO(unpacked(path)), delimiter=",", skiprows=1)


def with_csv_module(paths: list[Path]) -> None:
    for path in paths:
        rows = csv.reader(io.StringIO(unpacked(path)))
        next(rows)
        np.array([[float(cell) for cell in row] for row in rows])


def measure(places: list[Path], jobs: int, repeat: int) -> dict[str, object]:
    """Medians over ``repeat`` runs [s], and how many times longer the plain readers take."""
    recordings, _ = find_recordings(places)
    paths = [r.path for r in recordings if r.source == "nanobench"]
    times: dict[str, list[tuple[float, float]]] = {
        "cold": [],
        "cached": [],
        "uncached": [],
        "numpy.loadtxt": [],
        "csv + float": [],
    }
    for _ in range(repeat):
        with tempfile.TemporaryDirectory() as folder:
            os.environ["NANOBENCH_CACHE"] = folder
            times["cold"].append(seconds(lambda: load_recordings(paths, jobs=jobs)))
            times["cached"].append(seconds(lambda: load_recordings(paths, jobs=jobs)))
        times["uncached"].append(seconds(lambda: load_recordings(paths, jobs=jobs, cache=False)))
        times["numpy.loadtxt"].append(seconds(lambda: with_loadtxt(paths)))
        times["csv + float"].append(seconds(lambda: with_csv_module(paths)))
    median = {name: statistics.median(wall for wall, _ in t) for name, t in times.items()}
    processor = {name: statistics.median(cpu for _, cpu in t) for name, t in times.items()}
    return {
        "recordings": len(paths),
        "jobs": jobs,
        "repeat": repeat,
        "processors": len(os.sched_getaffinity(0)),
        "python": platform.python_version(),
        "seconds": {k: round(v, 3) for k, v in median.items()},
        "processor_seconds": {k: round(v, 3) for k, v in processor.items()},
        "ratio": {
            f"{slow} / {fast}": round(median[slow] / median[fast], 2)
            for slow in ("numpy.loadtxt", "csv + float")
            for fast in ("cold", "cached")
        },
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", action="append", type=Path, help="recordings (default: where nanobench looks)")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--repeat", type=int, default=3)
    options = parser.parse_args()
    places = options.data or default_data()
    if not places:
        parser.exit(2, "no recordings found; give --data\n")
    result = measure(places, options.jobs, options.repeat)
    print(json.dumps(result, indent=1))
    for name, ratio in result["ratio"].items():
        show(name, ratio, result["recordings"])


if __name__ == "__main__":
    main()
