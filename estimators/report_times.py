"""Times at which an estimator without timestamps reports."""

import numpy as np

from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight


def densest_stamps(flight: Flight) -> np.ndarray:
    """Timestamps (n,) s of the vehicle's stream with most rows, each once; InputError if it has none or no pose was
    given.

    Motion capture does not count: its stream holds only the poses that were given.
    """
    others = [stream.time_s for name, stream in flight.streams.items() if name != "mocap" and len(stream)]
    if not others or "mocap" not in flight or not len(flight["mocap"]):
        raise InputError(flight.provenance.path, "has no vehicle stream to report at, or no pose was given")
    return np.unique(max(others, key=len))
