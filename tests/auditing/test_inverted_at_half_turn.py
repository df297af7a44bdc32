"""Inverted quaternions at a heading of half a turn, where the tilt looks right, and those of an estimate alone."""

from dataclasses import replace

import numpy as np
import pytest

from nanobench_tools import so3
from nanobench_tools.auditing.faults import frame, quaternion_order, sign
from nanobench_tools.signals.context import Context
from nanobench_tools.sources.axes import frame_of, in_our_axes

QUATERNION = ("qx", "qy", "qz", "qw")


def _faults(flight):
    context = Context(flight)
    return [fault for check in (quaternion_order, sign, frame) for fault in check.find(flight, context)]


def _facing_back(flight):
    """The flight in a world turned by half a turn, so that its heading is 180 deg."""
    framed = ("mocap", "estimator", "estimator_acc", "attitude", "attitude_qw", "setpoint", "pid")
    turned = {}
    for name in framed:
        stream = flight[name]
        if name == "mocap":
            kept = [k for k, q in enumerate(stream.quantities) if q not in ("roll", "pitch", "yaw")]
            stream = replace(stream, values=stream.values[:, kept],
                             **{part: tuple(getattr(stream, part)[k] for k in kept)
                                for part in ("columns", "quantities", "unit")})
        turned[name] = in_our_axes(stream, frame_of("WSU/FLU"))
    return flight.with_streams(**turned)


def _inverted(flight, name):
    stream = flight[name]
    values = stream.values.copy()
    values[:, [stream.index(q) for q in QUATERNION]] = so3.conjugate(stream[QUATERNION])
    return flight.with_streams(**{name: replace(stream, values=values)})


@pytest.fixture(scope="module")
def back(crowd):
    return _facing_back(crowd.log("fast figure_eight")[0])


def test_a_heading_of_half_a_turn_is_no_finding(back):
    assert _faults(back) == []


def test_gyro_and_estimate_show_that_the_poses_are_inverted(back):
    (fault,) = _faults(_inverted(back, "mocap"))
    assert (fault.kind, fault.stream) == ("quaternion_order", "mocap")
    assert "change the sign of qx, qy, qz" in fault.evidence


def test_the_gyro_alone_asks_which_one_is_wrong(back):
    alone = back.without_streams("estimator", "estimator_acc", "attitude", "attitude_qw", "setpoint", "pid")
    found = _faults(_inverted(alone, "mocap"))
    assert {(f.kind, f.stream) for f in found} <= {("sign", "imu"), ("sign", "mocap")}
    assert found
    assert all("or the quaternions are inverted" in f.evidence for f in found)


@pytest.mark.parametrize("facing_back", [False, True])
def test_an_inverted_estimate_is_found_without_poses(crowd, back, facing_back):
    flight = (back if facing_back else crowd.log("fast figure_eight")[0]).without_streams("mocap", "attitude", "pid")
    assert _faults(flight) == []
    found = _faults(_inverted(flight, "attitude_qw"))
    assert {f.stream for f in found} == {"attitude_qw"}
    assert all("inverted" in f.evidence for f in found)


def test_a_path_above_zero_is_not_in_ned_because_of_its_tilt(crowd):
    poses = crowd.log("fast figure_eight")[0]["mocap"]
    flying = poses.rows((poses["pz"] > 0.3) & np.isfinite(poses["qx"]))
    flight = crowd.log("fast figure_eight")[0]
    flight = flight.without_streams(*(set(flight.streams) - {"mocap"})).with_streams(mocap=flying)
    found = _faults(_inverted(flight, "mocap"))
    assert found
    assert not any("NED" in f.evidence for f in found)
