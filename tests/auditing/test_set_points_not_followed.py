"""A vehicle that is sent rates does not follow the attitude set-points in its log."""

from dataclasses import replace

import numpy as np
import pytest

from nanobench_tools.auditing.faults import unit
from nanobench_tools.signals.context import Context


@pytest.fixture(scope="module")
def flown(crowd):
    return crowd.log("fast figure_eight")[0]


def _with_set_points(flight, angles):
    pid = flight["pid"]
    values = pid.values.copy()
    values[:, [pid.index(q) for q in ("roll", "pitch", "yaw")]] = angles
    return flight.with_streams(pid=replace(pid, values=values))


def _attitude(flight):
    at = flight["attitude"]
    return at.interpolate(("roll", "pitch", "yaw"), flight["pid"].time_s)


def test_a_heading_that_happens_to_agree_is_no_unit(flown):
    rng = np.random.default_rng(3)
    angles = np.concatenate([0.05 * rng.standard_normal((len(flown["pid"]), 2)), 0.3 * _attitude(flown)[:, 2:]], axis=1)
    bad = _with_set_points(flown, angles)
    assert not any(fault.stream == "pid" for fault in unit.find(bad, Context(bad)))


def test_set_points_in_degrees_are_found(flown):
    bad = _with_set_points(flown, np.rad2deg(_attitude(flown)))
    (fault,) = [fault for fault in unit.find(bad, Context(bad)) if fault.stream == "pid"]
    assert "57.3 times" in fault.evidence
