"""What a tracker writes while it does not see the body is one occlusion, and the rest of the flight stays usable."""

from dataclasses import replace

import numpy as np
import pytest

from nanobench_tools.auditing.audit_verdict import verdict_of
from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.flight import Flight, Provenance, make_stream
from nanobench_tools.sources.lost_poses import placeholders, without_placeholders

POSE = ("px", "py", "pz", "qx", "qy", "qz", "qw")


def circle(rate_hz=100.0, centre=(0.0, 0.0), digits=5, seed=1, noise=1.0):
    """8 s: stands, flies a circle of 0.8 m at 1 m with the tilt that this needs, lands."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 8.0, 1.0 / rate_hz)
    rise = np.clip(np.minimum(t - 1.0, 7.0 - t) / 0.8, 0.0, 1.0)
    angle = 1.4 * np.clip(t - 1.0, 0.0, 6.0)
    height = 0.02 + rise * rise * (3 - 2 * rise)
    p = np.stack([centre[0] + 0.8 * np.cos(angle), centre[1] + 0.8 * np.sin(angle), height], axis=1)
    p += noise * 3e-4 * rng.standard_normal(p.shape)
    tilt = 0.16 * rise[:, None] * np.stack([np.sin(angle), -np.cos(angle)], axis=1)
    tilt += noise * 1e-3 * rng.standard_normal(tilt.shape)
    yaw = 0.3 + noise * 0.002 * rng.standard_normal(len(t))
    q = np.column_stack([tilt / 2.0, np.sin(yaw / 2.0), np.cos(yaw / 2.0)])
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    return t, np.round(np.column_stack([p, q]), digits)


def flight(t, pose):
    return Flight("seen", {"mocap": make_stream("mocap", t, pose, POSE)}, {}, Provenance("seen", "", "test"))


def zeros(pose, rows):
    pose[rows] = 0.0


def zeros_and_identity(pose, rows):
    pose[rows] = (0, 0, 0, 0, 0, 0, 1)


def zeros_and_scalar_first(pose, rows):
    pose[rows] = (0, 0, 0, 1, 0, 0, 0)


def position_alone(pose, rows):
    pose[rows, :3] = 0.0


def not_numbers(pose, rows):
    pose[rows] = np.nan


def held(pose, rows):
    pose[rows] = pose[rows.start - 1]


def position_held(pose, rows):
    pose[rows, :3] = pose[rows.start - 1, :3]


def far_away(pose, rows):
    pose[rows] = (9999.99, 9999.99, 9999.99, 0, 0, 0, 1)


def rotation_alone(pose, rows):
    pose[rows, 3:] = 0.0


def identity_alone(pose, rows):
    pose[rows, 3:] = (0, 0, 0, 1)


WRITTEN = (zeros, zeros_and_identity, zeros_and_scalar_first, position_alone, not_numbers, held, position_held,
           far_away, rotation_alone, identity_alone)


RATES_HZ = (30.0, 100.0, 240.0)


@pytest.mark.parametrize(("written", "rate_hz"), [
    pytest.param(written, rate_hz, marks=[] if (i + k) % len(RATES_HZ) == 0 else pytest.mark.slow)
    for i, written in enumerate(WRITTEN) for k, rate_hz in enumerate(RATES_HZ)])
def test_one_occlusion_and_the_rest_is_usable(written, rate_hz):
    t, pose = circle(rate_hz)
    rows = slice(*np.searchsorted(t, (3.3, 3.75)))
    written(pose, rows)
    found = audit(flight(t, pose))
    assert {f.kind for f in found.faults} == {"mocap_occlusion"}
    (fault,) = found.faults
    assert (fault.start_s, fault.end_s) == pytest.approx((3.3, 3.75), abs=2.0 / rate_hz)
    verdict = verdict_of(found)
    assert verdict.severity == "cut"
    assert verdict.usable_s == pytest.approx(verdict.flight_s - 0.45, abs=3.0 / rate_hz)


@pytest.mark.parametrize("written", [zeros, zeros_and_identity, not_numbers], ids=lambda f: f.__name__)
def test_a_body_not_seen_at_first_and_seen_three_times_later(written):
    t, pose = circle()
    for span in ((0.0, 0.5), (2.5, 2.8), (4.0, 4.3), (5.0, 5.06)):
        written(pose, slice(*np.searchsorted(t, span)))
    found = audit(flight(t, pose))
    assert {f.kind for f in found.faults} == {"mocap_occlusion"}
    assert len(found.faults) == 4
    (span,) = found.airborne
    assert (span.start_s, span.end_s) == pytest.approx((1.0, 7.0), abs=0.3)


def test_single_zeros_are_missing_rows():
    t, pose = circle()
    pose[[300, 340, 341, 500], :] = 0.0
    assert np.flatnonzero(placeholders(flight(t, pose)["mocap"])).tolist() == [300, 340, 341, 500]
    assert not {f.kind for f in audit(flight(t, pose)).faults} & {"mocap_jump", "spike", "crash"}


def test_what_is_no_placeholder():
    t, pose = circle(centre=(-0.8, 0.0))
    standing = pose[0].copy()
    through = pose.copy()
    through[:, :3] -= through[350, :3]  # flies through the origin, exactly
    still = pose.copy()
    still[:90] = (0, 0, 0, 0, 0, 0, 1)  # a simulator that starts at the origin
    still[90:, :3] -= pose[90, :3]
    still[90:, 3:] = (0, 0, 0, 1)
    twice = np.repeat(pose[::4], 4, axis=0)[: len(t)]  # a slower tracker, held
    assert standing.any()
    for poses in (pose, through, still, twice):
        assert not placeholders(flight(t, poses)["mocap"]).any()


def test_other_columns_of_the_row_are_missing_too():
    t, pose = circle()
    zeros(pose, slice(300, 320))
    made = flight(t, pose)
    stream = made["mocap"]
    wide = replace(stream, values=np.column_stack([stream.values, np.ones(len(t))]), columns=(*POSE, "vx"),
                   quantities=(*POSE, "vx"), unit=(*stream.unit, "m/s"))
    read = without_placeholders(made.with_streams(mocap=wide))
    assert np.isnan(read["mocap"].values[300:320]).all()
    assert np.isfinite(np.delete(read["mocap"].values, slice(300, 320), axis=0)).all()
    assert "20 rows hold no pose" in read.provenance.notes[0]


@pytest.mark.parametrize("lose", [None, not_numbers, held])
def test_a_tracker_without_noise_at_rest_lost_no_vehicle_on_the_ground(lose):
    """Its poses repeat before take-off and after landing. What it loses in the air is found all the same."""
    t, pose = circle(noise=0.0, rate_hz=30.0)
    if lose is not None:
        lose(pose, slice(90, 105))
    found = [f for f in audit(flight(t, pose)).faults if f.kind != "interpolated"]
    assert [f.kind for f in found] == ([] if lose is None else ["mocap_occlusion"])
    assert all(3.0 - 0.1 < f.start_s < f.end_s < 3.5 + 0.1 for f in found)


@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_poses_that_stop_in_the_air_are_lost_to_the_end(noise):
    t, pose = circle(noise=noise, rate_hz=30.0)
    pose[150:] = pose[149]
    found = [f for f in audit(flight(t, pose)).faults if f.kind == "dead_stream"]
    assert [round(f.start_s, 1) for f in found] == [5.0]


def test_a_noisy_tracker_that_stands_still_on_the_ground_is_dead():
    t, pose = circle(rate_hz=30.0)
    pose[225:] = pose[224]
    assert "dead_stream" in {f.kind for f in audit(flight(t, pose)).faults}
