"""Turning that only another vehicle explains is no agreement; the numbers are of an arm ten times too long."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from identification.mismatch.diagnosis import _no_vehicle

WHY = {"inertia": "inertia would be 5.3 times what is believed: no vehicle"}


def test_turning_of_another_vehicle_is_unknown():
    found = _no_vehicle(SimpleNamespace(rejected=WHY, before=np.array([5.0, 21.0, 72.0, 2405.0, 2084.0, 54.0])))
    assert found.axes == ("torque x", "torque y")
    assert "5.3 times" in found.hint


def test_a_right_simulator_is_left_alone():
    quiet = np.array([5.0, 21.0, 71.0, 0.0, 0.0, 55.0])
    assert _no_vehicle(SimpleNamespace(rejected=WHY, before=quiet)) is None
    assert _no_vehicle(SimpleNamespace(rejected={}, before=10.0 * quiet + 900.0)) is None
