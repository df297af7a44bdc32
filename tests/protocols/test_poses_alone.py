"""Poses alone as truth: velocity is derived, and a trajectory that covers a part is scored on that part."""

from dataclasses import replace

import numpy as np
import pytest

from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight, Provenance, make_stream
from nanobench_tools.protocols import task3
from nanobench_tools.signals.derived_velocity import velocity_of
from nanobench_tools.sources.trajectory_file import TrajectoryFile

POSE = ("px", "py", "pz", "qx", "qy", "qz", "qw")
SECONDS = 20.0


def circle(time_s):
    """(n, 7): a circle of 1 m radius flown at 1 m/s, up to 1 m within two seconds and down again."""
    height = np.clip(time_s / 2.0, 0.0, 1.0) * np.clip((SECONDS - time_s) / 2.0, 0.0, 1.0)
    return np.column_stack([np.sin(time_s), np.cos(time_s), height, *np.zeros((3, len(time_s))), np.ones(len(time_s))])


def poses_only(rate_hz=100.0, epoch_s=0.0, rows=None):
    time_s = np.arange(0.0, SECONDS, 1.0 / rate_hz)
    values = circle(time_s) if rows is None else rows(time_s)
    return Flight("poses", {"mocap": make_stream("mocap", time_s, values, POSE, rate_hz=rate_hz)},
                  {"family": None, "speed": None, "reference_speed_m_s": None},
                  Provenance("poses.csv", "0" * 64, "table"), epoch_s=epoch_s)


def the_case(flight):
    case, = task3.select([flight], {flight.name: audit(flight)}, "clean")
    return case


def trajectory(tmp_path, time_s, offset_m=(0.01, 0.0, 0.0), epoch_s=0.0):
    """slam/poses.tum: the circle moved by a constant."""
    rows = circle(time_s)
    rows[:, :3] += offset_m
    folder = tmp_path / "slam"
    folder.mkdir(exist_ok=True)
    np.savetxt(folder / "poses.tum", np.column_stack([time_s + epoch_s, rows]), fmt="%.9f")
    return TrajectoryFile(folder / "poses.tum")


TIMES = {"whole": lambda t: t >= 0.0, "later": lambda t: t > 3.0, "ends early": lambda t: t < 12.0,
         "hole": lambda t: (t < 6.0) | (t > 11.0)}


@pytest.mark.parametrize("part", TIMES)
@pytest.mark.parametrize(("rate_hz", "own_hz"), [(100.0, 100.0), (240.0, 20.0), (30.0, 5.0)])
def test_a_constant_offset_of_1_cm_is_an_error_of_10_mm_on_the_part_that_is_covered(tmp_path, part, rate_hz, own_hz):
    case = the_case(poses_only(rate_hz, epoch_s=1.6e9))
    stamps = np.arange(0.0, SECONDS, 1.0 / own_hz)
    stamps = stamps[TIMES[part](stamps)]
    scored = task3.score(case, trajectory(tmp_path, stamps, epoch_s=1.6e9), "clean")
    # what the line between truth rows 1/30 s apart leaves of a circle: (1/30)^2 / 8 m = 0.14 mm at most
    assert scored.metrics["ate_unaligned_rmse_m"] == pytest.approx(0.010, abs=2e-4)
    assert scored.metrics["ate_rmse_m"] < 2e-4
    truth = case.flight["mocap"].time_s
    truth = truth[case.spans[0].mask(truth)]
    near = np.abs(truth[:, None] - stamps[None, case.spans[0].mask(stamps)]).min(axis=1) <= 0.1 + 1e-9
    assert scored.metrics["covered_percent"] == pytest.approx(100.0 * near.mean())


def test_a_trajectory_of_another_time_is_a_line_with_both_times(tmp_path):
    case = the_case(poses_only())
    late = trajectory(tmp_path, np.arange(0.0, 5.0, 0.1), epoch_s=1.7e9)
    with pytest.raises(InputError, match=r"poses\.tum: 0 of 50 timestamps lie in the scored part .* 1700000000\.000 .* "
                                         r"that part from 0\.\d+ to 19\.\d+ s"):
        task3.score(case, late, "clean")


def test_a_part_is_ranked_against_nothing(tmp_path):
    file = trajectory(tmp_path, np.arange(0.0, 1.0, 0.1))
    whole, part = (task3.inputs_of(file, "", share) for share in (100.0, 60.0))
    assert whole != part
    assert "slam covers 60 %" in part


def test_the_velocity_of_a_circle_is_its_tangent():
    time_s = np.sort(np.random.default_rng(3).uniform(0.0, 6.0, 600))
    found = velocity_of(time_s, circle(time_s)[:, :3])[5:-5]
    tangent = np.column_stack([np.cos(time_s), -np.sin(time_s)])[5:-5]
    # uneven steps: the slope of the line through a hole of h s is off by h / 2 (1 m/s^2)
    assert np.abs(found[:, :2] - tangent).max() < 0.5 * np.diff(time_s).max() + 1e-3
    even = np.arange(0.0, 6.0, 0.01)
    assert np.abs(velocity_of(even, circle(even)[:, :3])[1:-1, :2] - np.column_stack(
        [np.cos(even), -np.sin(even)])[1:-1]).max() < 2e-5  # h^2 / 6


def test_derived_velocity_is_said_and_a_measured_one_is_kept():
    flight = poses_only()
    case = the_case(flight)
    assert task3.DERIVED in case.note
    time_s, mocap = flight["mocap"].time_s, flight["mocap"]
    velocity = velocity_of(time_s, mocap.values[:, :3]) + 0.01
    measured = make_stream("mocap", time_s, np.column_stack([mocap.values, velocity]), (*POSE, "vx", "vy", "vz"),
                           rate_hz=100.0)
    kept = the_case(replace(flight, streams={"mocap": measured}))
    assert task3.DERIVED not in kept.note
    assert kept.flight["mocap"]["vx"] == pytest.approx(velocity[:, 0])


def test_a_body_that_moves_at_one_height_was_in_the_air_and_one_at_rest_was_not():
    def level(time_s, still):
        rows = circle(time_s)
        rows[:, 2] = 1.0
        rows[:, :2] *= 0.0 if still else 1.0
        rows[:, :3] += 2e-4 * np.random.default_rng(1).standard_normal((len(time_s), 3))
        return rows

    moved, rested = (audit(poses_only(rows=lambda t, still=still: level(t, still))) for still in (False, True))
    assert sum(span.duration_s for span in moved.airborne) == pytest.approx(SECONDS, abs=0.1)
    assert rested.airborne == ()
    assert "never_flew" in {fault.kind for fault in rested.faults}
