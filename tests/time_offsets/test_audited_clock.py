"""The audit carries the moving error: as a fault with its size, and over time in the clock of every stream."""

import json

import numpy as np
import pytest

from nanobench_tools.auditing.recording_audit import Audit, audit
from nanobench_tools.flight import Flight
from nanobench_tools.signals.context import Context
from nanobench_tools.time_offsets.moving.confirm import believed
from nanobench_tools.time_offsets.moving.time_offset import TimeOffset, wander_of


@pytest.fixture(scope="module")
def recording(crowd):
    return lambda **chain: crowd.log("medium trefoil", **chain)[0]


def test_wander_is_a_fault_with_its_course(recording):
    flight = recording(wander_sd_s=0.03)
    verdict = Audit.from_json(json.loads(json.dumps(audit(flight).to_json())))
    found = {f.stream: f for f in verdict.faults if f.kind == "clock_wander"}
    assert {"imu", "estimator"} <= set(found)
    assert found["imu"].size == pytest.approx(0.03, abs=0.01)
    assert "which it never saw" in found["imu"].evidence or "what it never saw" in found["imu"].evidence
    course = np.array(verdict.clock["imu"].warp)
    assert verdict.clock["estimator"].warp == verdict.clock["imu"].warp  # one clock
    time_offset = believed(Context(flight))
    assert len(course) < len(time_offset.time_s)
    assert np.abs(np.interp(time_offset.time_s, course[:, 0], course[:, 1]) - time_offset.offset_s).max() < 0.0011
    assert not any(f.kind == "clock_drift" for f in verdict.faults)


@pytest.mark.parametrize("offset_s", [0.0, 0.06])
@pytest.mark.slow
def test_a_constant_is_no_wander(recording, offset_s):
    verdict = audit(recording(offset_s=offset_s))
    assert not any(f.kind == "clock_wander" for f in verdict.faults)
    assert verdict.clock["imu"].warp == ()


@pytest.mark.slow
def test_a_line_is_a_drift_and_no_wander(recording):
    flight = recording()
    slow = {n: s if n == "mocap" else s.__class__(**{**s.__dict__, "time_s": s.time_s * 1.002})
            for n, s in flight.streams.items()}
    kinds = {f.kind for f in audit(Flight("drifts", slow, {}, flight.provenance)).faults}
    assert "clock_drift" in kinds
    assert "clock_wander" not in kinds


def test_wander_is_about_a_line():
    t = np.linspace(0.0, 10.0, 1001)
    assert wander_of(t, 0.01 + 0.003 * t) == pytest.approx(0.0, abs=1e-12)
    assert wander_of(t, 0.01 + 0.003 * t + 0.02 * np.sign(np.sin(9.0 * t))) == pytest.approx(0.02, rel=0.02)


def test_points_of_a_hand_made_course():
    t = np.arange(0.0, 1.001, 0.01)
    saw = np.where(t < 0.5, 0.1 * t, 0.1 * (t - 0.5))
    time_offset = TimeOffset(t, saw, np.full(len(t), 0.001), 0.0, 0.01, True, {}, "test")
    points = np.array(time_offset.points())
    assert len(points) == 4
    assert points[:, 0].tolist() == pytest.approx([0.0, 0.49, 0.5, 1.0])
