"""Axes that several streams share are one finding with one frame, and streams that are turned as it says are clean."""

import re
from dataclasses import replace

import numpy as np
import pytest

from nanobench_tools.auditing.fault_events import events_of
from nanobench_tools.auditing.faults import axis_swap, body_frame, frame, quaternion_order, sign
from nanobench_tools.signals.context import Context
from nanobench_tools.sources.axes import Frame, frame_of, in_our_axes

CHECKS = (frame, sign, axis_swap, quaternion_order, body_frame)
VEHICLE = ("imu", "estimator", "estimator_acc", "attitude", "attitude_qw", "setpoint", "pid")
ANGLES = ("attitude", "setpoint", "pid")
"""Angles of Euler have no meaning close to a quarter turn of pitch, as in a world with y up."""


def _faults(flight):
    context = Context(flight)
    return [fault for check in CHECKS for fault in check.find(flight, context)]


def _in(flight, axes, streams):
    """The flight as a program with these axes writes it."""
    ours = frame_of(axes)
    theirs = Frame(axes, ours.world.T, ours.body.T)
    turned = {name: in_our_axes(flight[name], theirs) for name in streams if name in flight}
    return flight.with_streams(**{name: replace(s, columns=s.quantities) for name, s in turned.items()})


@pytest.mark.parametrize("axes", ["NED/FRD", "EUS/FUR", pytest.param("SWD/FRD", marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", ["fast figure_eight", pytest.param("slow trefoil", marks=pytest.mark.slow)])
@pytest.mark.parametrize("without", [(), ("mocap",), ("estimator", "setpoint", "estimator_acc")])
def test_a_recording_in_other_axes_as_a_whole_is_one_finding_and_its_frame_mends_it(crowd, name, axes, without):
    flight = crowd.log(name)[0].without_streams(*without, *ANGLES * (axes == "EUS/FUR"))
    assert _faults(flight) == []
    bad = _in(flight, axes, ("mocap", *VEHICLE))
    found = _faults(bad)
    (event,) = events_of(found)
    assert {fault.stream for fault in found} == {s for s in ("mocap", *VEHICLE) if s in flight}
    written = re.search(r'frame = "(\S+)"', event.sentence)[1]
    mended = bad.with_streams(**{f.stream: in_our_axes(bad[f.stream], frame_of(written)) for f in found})
    assert _faults(mended) == []
    up = mended["mocap" if "mocap" in mended else "estimator"]
    assert np.ptp(up["pz" if "pz" in up else "z"]) == pytest.approx(np.ptp(flight[
        "mocap" if "mocap" in flight else "estimator"]["pz" if "pz" in up else "z"]))


@pytest.mark.parametrize("without", [(), ("estimator", "setpoint", "estimator_acc")])
def test_a_vehicle_in_ned_beside_poses_with_z_up_is_not_blamed_on_the_poses(crowd, without):
    flight = crowd.log("fast figure_eight")[0].without_streams(*without)
    bad = _in(flight, "NED/FRD", VEHICLE)
    found = _faults(bad)
    assert {fault.stream for fault in found} == {s for s in VEHICLE if s in flight}
    (event,) = events_of(found)
    assert 'write frame = "NED/FRD"' in event.sentence


def test_gravity_against_attitude_and_gyro_that_agree_asks_for_both(crowd):
    flight = crowd.log("fast figure_eight")[0].without_streams("mocap", "estimator", "setpoint", "estimator_acc", "pid")
    (fault,) = _faults(_in(flight, "NED/FRD", VEHICLE))
    assert 'write frame = "NED/FRD" into both' in fault.evidence
