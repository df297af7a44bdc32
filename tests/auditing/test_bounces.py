"""A vehicle that strikes the ground and bounces: the path turns round in a row, and that is no spike."""

from dataclasses import replace

import numpy as np
from one_kind import faults_of

from nanobench_tools.flight import Flight


def landed_hard(flight: Flight, off_m: float = 0.0) -> Flight:
    """The flight ended by a fall of 2.5 m/s and a bounce of 1.2 m/s, one row ``off_m`` off."""
    mocap = flight["mocap"]
    t, values = mocap.time_s, mocap.values.copy()
    z = values[:, mocap.index("pz")]
    ground = float(np.median(z[:50]))
    high = np.flatnonzero(z > ground + 0.4)[-1]
    row = high + round((z[high] - ground) / 0.025)
    struck = t[row] - 0.003
    fall, since = ground + (z[high] - ground) * (struck - t) / (struck - t[high]), np.maximum(t - struck, 0.0)
    bounce = np.maximum(ground + 1.2 * since - 4.905 * since**2, ground)
    z[high:] = np.where(t < struck, fall, bounce)[high:]
    z[row + 8] += off_m
    return flight.with_streams(mocap=replace(mocap, values=values))


def spikes(flight: Flight) -> list[float]:
    return [f.start_s for f in faults_of(flight, "spike") if f.stream == "mocap"]


def test_a_bounce_is_no_spike_and_a_spike_in_it_is_one(flights):
    flight = next(f for f in flights if not spikes(f))
    assert spikes(landed_hard(flight)) == []
    assert len(spikes(landed_hard(flight, 0.2))) == 1
