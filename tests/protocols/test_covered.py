"""The part of a flight that an estimate covers, and which estimates are refused."""

from dataclasses import replace

import numpy as np
import pytest
from cases_of_task3 import EKF, From, one_case, poses
from made_flights import dead, made_flight

from nanobench_tools import Estimate, InputError
from nanobench_tools.protocols import task3
from nanobench_tools.protocols.trajectories import write_tum
from nanobench_tools.sources.trajectory_file import TrajectoryFile


def test_the_given_poses_alone_are_no_estimate():
    with pytest.raises(InputError, match=r"estimator mine has 0 timestamps .* covers 0\.0 % of it, 10 timestamps"):
        task3.score(one_case(made_flight()), From(lambda given: poses(given["mocap"])), "clean")


@pytest.mark.parametrize("protocol", ["clean", "as-published", "as-published-corrected"])
@pytest.mark.parametrize(("until_s", "every", "share"), [(12.0, 1, 48.0), (21.0, 1, 91.0), (22.8, 1, 100.0),
                                                         (22.8, 20, 100.0), (22.8, 40, 52.5)])
def test_an_estimate_is_scored_on_the_part_that_it_covers(protocol, until_s, every, share):
    flight = made_flight()
    mocap = flight["mocap"]
    case = one_case(flight, protocol=protocol)
    rows = np.flatnonzero(mocap.time_s < until_s)[::every]
    scored = task3.score(case, From(lambda given: poses(mocap, rows, off_m=0.01)), protocol)
    assert scored.metrics["covered_percent"] == pytest.approx(share, abs=4.0)
    row = task3.tabulate(protocol, From(None), [(case, scored)])[0]
    assert (f"mine covers {scored.metrics['covered_percent']:.0f} %" in row.inputs) is (share < 95.0)


def test_a_few_stamps_are_no_estimate():
    mocap = made_flight()["mocap"]
    few = From(lambda given: poses(mocap, np.flatnonzero(mocap.time_s > 5.0)[:9 * 20:20]))
    with pytest.raises(InputError, match=r"has 9 timestamps .* covers \d+\.\d % of it, 10 timestamps are needed"):
        task3.score(one_case(made_flight()), few, "clean")


def test_a_hole_in_the_truth_is_not_asked_for():
    flight = made_flight()
    case = one_case(flight, replace(dead("mocap", 8.0, 14.0), kind="mocap_occlusion"))
    mocap = flight["mocap"]
    rows = np.flatnonzero((mocap.time_s < 8.0) | (mocap.time_s > 14.0))
    assert task3.score(case, From(lambda given: poses(mocap, rows)), "clean").rows > 1000


def test_peeking_at_the_given_poses_brings_nothing():
    flight = made_flight()
    case = one_case(flight)
    mocap = flight["mocap"]
    start = case.spans[0].start_s + task3.GIVEN_S

    def peeking(given, off_m=0.5):
        found = poses(mocap, off_m=0.1)
        early = mocap.time_s <= given["mocap"].span.end_s
        found.position_m[early] -= 0.1 * off_m
        return found

    values = [task3.score(case, From(lambda given, off_m=off_m: peeking(given, off_m)), "clean")
              for off_m in (0.0, 1.0)]
    assert values[0].trajectory[0, 0] > start
    assert values[0].metrics == pytest.approx(values[1].metrics, nan_ok=True)


def test_a_trajectory_file_of_a_few_poses_fails_and_the_logged_one_is_scored_from_its_first_row(tmp_path):
    flight = made_flight()
    case = one_case(flight)
    value = task3.score(case, EKF, "clean")
    assert value.trajectory[0, 0] == pytest.approx(case.spans[0].start_s, abs=0.01)
    path = tmp_path / "made.tum"
    write_tum(path, flight, value.trajectory)
    assert task3.score(case, TrajectoryFile(path), "clean").rows == value.rows
    write_tum(path, flight, value.trajectory[:8])
    with pytest.raises(InputError, match=r"made\.tum: 8 of 8 timestamps lie in the scored part .*, 10 are needed"):
        task3.score(case, TrajectoryFile(path), "clean")


@pytest.mark.parametrize(("found", "says"), [
    (Estimate(np.arange(3.0), np.zeros((3, 2)), np.ones((3, 4))), "same number of rows"),
    (Estimate(np.array([5.0, 4.0, 6.0]), np.zeros((3, 3)), np.ones((3, 4))), "do not rise"),
    (Estimate(np.array([5.0, 6.0, 7.0]), np.full((3, 3), np.nan), np.ones((3, 4))), "no pose at 5.000 s"),
    (Estimate(np.array([5.0, 6.0, 7.0]), np.zeros((3, 3)), np.zeros((3, 4))), "no pose at 5.000 s"),
    (Estimate(np.arange(3.0) + 1e9, np.zeros((3, 3)), np.ones((3, 4))), "0 timestamps in the scored part"),
    (None, "gave no time_s")])
def test_what_is_no_trajectory_is_said_in_one_line(found, says):
    class Bad:
        name, causal = "bad", True

        def estimate(self, flight):
            return found

    with pytest.raises(InputError, match=says) as caught:
        task3.score(one_case(made_flight()), Bad(), "clean")
    assert "bad" in str(caught.value)
    assert "made.csv" in str(caught.value)
    assert "\n" not in str(caught.value)
