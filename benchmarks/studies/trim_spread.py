"""How much the steady trim of a vehicle differs from flight to flight: the prior of ``mismatch.steady.weigh``.

    python -m benchmarks.studies.trim_spread [DIR ...]

Flights are taken in the order they were flown; the difference between neighbours, over the root of two, is the spread
of a flight. The median (times 1.4826) leaves out the few steps at which the vehicle, or its battery, was changed;
the root mean square holds them. Judged folders of a proof take no part in it.
"""

import sys
from pathlib import Path

import numpy as np

from identification.mismatch.steady.trim import trim_of
from identification.mismatch.steady.weigh import GROUPS
from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.auditing.selection import distinct
from nanobench_tools.errors import NanobenchError
from nanobench_tools.sources.discover import default_data, load_recordings

ROBUST = 1.4826


def main(places: list[str]) -> None:
    loaded = load_recordings([Path(p) for p in places] or default_data() or [])
    flights = sorted((f for f in distinct(loaded.flights)[0]), key=lambda f: f.epoch_s)
    trims = []
    for flight in flights:
        try:
            trims.append(trim_of(flight, audit(flight)))
        except NanobenchError as error:
            print(error, file=sys.stderr)
    print(f"{len(trims)} flights, steps from one to the next")
    for name in GROUPS:
        steps = np.diff([getattr(t, name) for t in trims], axis=0) / np.sqrt(2.0)
        robust = ROBUST * np.median(np.abs(steps), axis=0)
        print(f"{name}: robust {np.round(robust, 4)} median {np.nanmedian(robust):.4f}, root mean square "
              f"{np.round(np.sqrt(np.mean(steps**2, axis=0)), 4)}")


if __name__ == "__main__":
    main(sys.argv[1:])
