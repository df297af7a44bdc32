"""Markers that were defined while the vehicle pointed elsewhere turn the tracked body against the gyro."""

from dataclasses import replace

import numpy as np
import pytest
from one_kind import faults_of
from scipy.spatial.transform import Rotation

from nanobench_tools.auditing.recording_audit import audit

TURN = ("qx", "qy", "qz", "qw")


def with_body(flight, degrees, axis="z"):
    mocap = flight["mocap"]
    values, at = mocap.values.copy(), [mocap.index(q) for q in TURN]
    good = np.isfinite(values[:, at]).all(axis=1)
    values[np.ix_(good, at)] = (Rotation.from_quat(values[np.ix_(good, at)])
                                * Rotation.from_euler(axis, degrees, degrees=True)).as_quat()
    return flight.with_streams(mocap=replace(mocap, values=values)).without_streams("attitude", "attitude_qw")


def told(flight):
    return faults_of(flight, "body_frame")


@pytest.mark.parametrize("degrees", [25.0, 45.0, -35.0])
def test_a_heading_of_the_markers_is_found_with_its_angle(crowd, degrees):
    (fault,) = told(with_body(crowd.log("fast figure_eight")[0], degrees))
    assert fault.stream == "mocap"
    assert np.degrees(fault.size) == pytest.approx(abs(degrees), abs=4.0)
    assert f"{'-' * (degrees < 0)}{np.degrees(fault.size):.0f} deg about z against the gyro" in fault.evidence


@pytest.mark.parametrize(("name", "degrees"), [("fast figure_eight", 0.0), ("fast figure_eight", 8.0), ("circle", 0.0),
                                               ("fast trefoil", 0.0), ("fast figure_eight", 90.0)])
def test_small_turns_circles_and_quarter_turns_are_none(crowd, name, degrees):
    """A quarter turn is ``frame``; a circle fits a delay."""
    flight = with_body(crowd.log(name)[0], degrees)
    assert told(flight) == []
    assert bool(faults_of(flight, "frame")) == (degrees == 90.0)


def test_a_clock_that_the_motion_capture_does_not_show_is_listed(crowd):
    flight = crowd.log("fast figure_eight")[0]
    assert not any(entry.startswith("clock") for entry in audit(flight).unchecked)
    imu = flight["imu"]
    still = replace(imu, values=np.where(np.arange(imu.values.shape[1]) < 3, imu.values,
                                         0.01 * np.random.default_rng(1).standard_normal(imu.values.shape)))
    lone = flight.with_streams(imu=still).without_streams("attitude", "attitude_qw", "estimator", "estimator_acc")
    assert "clock of imu" in audit(lone).unchecked
