"""Cold read and audit of all recordings: seconds, which part takes them, and a plain reader of the same files.

python benchmarks/speed/audit_speed.py [--data DIR...] [--most N] [--jobs 2]

Cold: nothing is taken from the cache of parsed recordings. The read and the audit of one recording are one item, as in
a user's first ``nanobench audit``. Then come the audits alone, on one core, and the largest recording. The plain
reader (``read_speed.py``: csv module and ``float``) says how fast the machine is. Without recordings, practice flights
(SYNTHETIC).
"""

import argparse
import tempfile
import time
from pathlib import Path

import joblib
import numpy as np
from kept import show
from read_speed import with_csv_module

from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.practice.flights import write_practice
from nanobench_tools.sources.discover import default_data, find_recordings, read

PLAIN = 10
"""Recordings for the plain reader, and practice flights where there are no recordings."""


def cold(recording) -> tuple[str, float, float]:
    """Name, seconds of reading, seconds of auditing."""
    start = time.perf_counter()
    flight = read(recording, cache=False)
    middle = time.perf_counter()
    audit(flight)
    return flight.name, middle - start, time.perf_counter() - middle


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", nargs="*", type=Path)
    parser.add_argument("--most", type=int, help="audit that many recordings, spread over all; default: every one")
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        data = options.data or default_data()
        if not data:
            write_practice(Path(folder), PLAIN, 0)
            print("SYNTHETIC: practice flights")
        measure(data or [Path(folder)], options)


def measure(data: list[Path], options: argparse.Namespace) -> None:
    start = time.perf_counter()
    recordings, failed = find_recordings(data)
    if options.most and len(recordings) > options.most:
        recordings = [recordings[k] for k in np.linspace(0, len(recordings) - 1, options.most).astype(int)]
    rows = joblib.Parallel(n_jobs=options.jobs)(joblib.delayed(cold)(r) for r in recordings)
    wall = time.perf_counter() - start
    reading, auditing = (np.array([row[k] for row in rows]) for k in (1, 2))
    slowest = max(rows, key=lambda row: row[2])
    print(f"{len(rows)} recordings, {len(failed)} failed, {options.jobs} jobs: cold read and audit {wall:.1f} s")
    print(f"  read  median {np.median(reading):.3f} s, sum {reading.sum():.1f} s")
    print(
        f"  audit median {np.median(auditing):.3f} s, sum {auditing.sum():.1f} s, "
        f"slowest {slowest[2]:.3f} s ({slowest[0]})"
    )
    csvs = [r.path for r in recordings if r.source == "nanobench"][:PLAIN]
    if csvs:
        start = time.perf_counter()
        with_csv_module(csvs)
        plain = (time.perf_counter() - start) / len(csvs)
        show("plain csv reading / reading and audit of one recording", plain / (reading + auditing).mean(), len(rows))


if __name__ == "__main__":
    main()
