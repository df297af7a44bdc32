"""Velocities of the motion capture and of the estimate in other axes than their positions."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.flight import Flight, Provenance, make_stream

POSE = ("px", "py", "pz", "qx", "qy", "qz", "qw")
VELOCITY = ("vx", "vy", "vz")


@pytest.fixture(scope="module")
def poses(crowd):
    """The path in a world in which the vehicle heads 60 deg to the left of x, with its velocity."""
    mocap = crowd.log("fast figure_eight")[0]["mocap"]
    good = np.isfinite(mocap[POSE]).all(axis=1)
    t, values = mocap.time_s[good], mocap[POSE][good]
    heading = Rotation.from_euler("z", 60.0, degrees=True)
    place = heading.apply(values[:, :3])
    smooth = np.stack([np.convolve(v, np.ones(9) / 9.0, mode="same") for v in place.T], axis=1)
    return t, place, heading * Rotation.from_quat(values[:, 3:]), np.gradient(smooth, t, axis=0)


def told(poses, change):
    t, place, turn, velocity = poses
    mocap = make_stream("mocap", t, np.hstack([place, turn.as_quat(), change(turn, velocity)]), (*POSE, *VELOCITY))
    found = audit(Flight("poses", {"mocap": mocap}, {}, Provenance("made", "", "test")))
    return [f for f in found.faults if f.kind in ("frame", "sign", "axis_swap", "unit")]


def test_a_velocity_in_the_world_is_none(poses):
    assert told(poses, lambda turn, v: v) == []


def test_a_velocity_in_the_body_is_found(poses):
    (fault,) = told(poses, lambda turn, v: turn.inv().apply(v))
    assert (fault.kind, fault.columns) == ("frame", VELOCITY)
    assert "in the axes of the body" in fault.evidence


def test_a_velocity_in_ned_is_found(poses):
    (fault,) = told(poses, lambda turn, v: v[:, [1, 0, 2]] * [1.0, 1.0, -1.0])
    assert (fault.kind, fault.columns) == ("frame", VELOCITY)
    assert "read vx = vy, vy = vx, vz = -vz" in fault.evidence


def test_an_estimated_velocity_in_the_body_is_found(poses):
    t, place, turn, velocity = poses
    rng = np.random.default_rng(1)
    own = np.hstack([place + 0.002 * rng.standard_normal(place.shape), turn.inv().apply(velocity)])
    streams = {"estimator": make_stream("estimator", t, own, ("x", "y", "z", *VELOCITY)),
               "attitude_qw": make_stream("attitude_qw", t, turn.as_quat(), POSE[3:])}
    faults = [f for f in audit(Flight("own", streams, {}, Provenance("made", "", "test"))).faults if f.kind == "frame"]
    assert [f.stream for f in faults] == ["estimator"]
    assert "in the axes of the body" in faults[0].evidence


@pytest.mark.parametrize("rate_hz", [20.0, 10.0])
@pytest.mark.parametrize("factor", [1.0, 3.6, 1000.0])
def test_velocities_of_a_slow_tracker_are_compared_with_its_path(poses, rate_hz, factor):
    t, *columns = poses
    rows = np.searchsorted(t, np.arange(t[0], t[-1], 1.0 / rate_hz))
    slow = (t[rows], *(c[rows] for c in columns))
    found = told(slow, lambda turn, v: factor * v)
    assert [(f.kind, f.columns) for f in found] == ([] if factor == 1.0 else [("unit", VELOCITY)])


@pytest.mark.parametrize("place", ["mocap", "estimator"])
@pytest.mark.parametrize(("one", "other"), [(i, j) for j in range(3, 6) for i in range(j)])
def test_columns_of_position_and_velocity_that_changed_places_are_found(poses, place, one, other):
    """On a circle with a slow rise each velocity has the shape of another axis of the path."""
    t = poses[0] - poses[0][0]
    path = np.stack([np.cos(0.7 * t), np.sin(0.7 * t), 1.0 + 0.2 * np.sin(t)], axis=1)
    path += 3e-4 * np.random.default_rng(2).standard_normal(path.shape)
    speed = np.stack([-0.7 * np.sin(0.7 * t), 0.7 * np.cos(0.7 * t), 0.2 * np.cos(t)], axis=1)
    values = np.hstack([path, speed])
    names = ("px", "py", "pz", *VELOCITY) if place == "mocap" else ("x", "y", "z", *VELOCITY)

    def found(values):
        faults = audit(Flight("made", {place: make_stream(place, t, values, names)}, {},
                              Provenance("made", "", "test"))).faults
        return [f.kind for f in faults if f.kind in ("frame", "sign", "axis_swap", "unit", "constant_offset")]

    assert found(values) == []
    values[:, [one, other]] = values[:, [other, one]]
    assert found(values)
