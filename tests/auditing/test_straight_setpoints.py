"""Setpoints that run straight by plan are no gap; packets that are missing on a bent path are."""

from dataclasses import replace

import numpy as np
import pytest
from one_kind import faults_of


def gaps(flight, xyz):
    stream = flight["setpoint"]
    values = stream.values.copy()
    values[:, [stream.index(q) for q in ("x", "y", "z")]] = xyz
    found = faults_of(flight.with_streams(setpoint=replace(stream, values=values)), "gap")
    return [(f.start_s, f.end_s) for f in found if f.stream == "setpoint"]


def test_a_path_that_straightens_before_a_corner_has_no_gap(flights):
    """Its heading settles after each corner: what is left of the bend falls below what is printed, until the next."""
    time_s = flights[0]["setpoint"].time_s
    since = np.mod(time_s, 3.0)
    heading = 2.5 * np.floor(time_s / 3.0) + 0.5 * np.exp(-since / 0.12)
    steps = 0.003 * np.stack([np.cos(heading), np.sin(heading), np.zeros(len(time_s))], axis=1)
    assert gaps(flights[0], (np.cumsum(steps, axis=0) + 1.0).round(9)) == []


@pytest.mark.parametrize("lost_s", [0.35, 0.8])
def test_packets_missing_on_a_circle_are_a_gap(flights, lost_s):
    time_s = flights[0]["setpoint"].time_s
    xyz = np.stack([np.cos(0.8 * time_s), np.sin(0.8 * time_s), np.full(len(time_s), 1.0)], axis=1).round(8)
    inside = (time_s > 8.0) & (time_s < 8.0 + lost_s)
    for k in range(3):
        xyz[inside, k] = np.interp(time_s[inside], time_s[~inside], xyz[~inside, k])
    (found,) = gaps(flights[0], xyz)
    assert found == pytest.approx((8.0, 8.0 + lost_s), abs=0.025)
