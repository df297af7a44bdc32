"""Scores of one estimate on one flight: made ones with known errors, and evo on a real flight."""

import numpy as np
import pytest
from cases_of_task3 import EKF, one_case
from made_flights import circle, made_flight

from nanobench_tools import Estimate, so3
from nanobench_tools.flight import make_stream
from nanobench_tools.metrics import trajectory
from nanobench_tools.protocols import task3
from nanobench_tools.sources.discover import load_recordings


def test_a_late_estimate_scores_what_it_should():
    flight = made_flight(late_s=0.03)
    metrics = task3.score(one_case(flight), EKF, "clean").metrics
    assert metrics["delay_s"] == pytest.approx(0.03, abs=5e-4)
    assert metrics["across_track_delay_removed_rmse_m"] < 1e-3
    assert metrics["ate_delay_removed_rmse_m"] < 0.05 * metrics["ate_unaligned_rmse_m"]
    assert metrics["ate_rmse_m"] <= metrics["ate_yaw_rmse_m"] <= metrics["ate_unaligned_rmse_m"]
    assert metrics["velocity_rmse_m_s"] == 0.0
    assert metrics["attitude_geodesic_rmse_deg"] == pytest.approx(0.0, abs=1e-9)


def test_velocity_residuals_and_progress_are_those_of_the_estimate():
    flight = made_flight()

    class Drifting:
        """10 mm/s along y, from the first row on, and 0.1 m/s too fast along z."""

        name, causal = "drifting", False

        def estimate(self, given):
            m = flight["mocap"]
            place, speed = m["px", "py", "pz"].copy(), m["vx", "vy", "vz"].copy()
            place[:, 1] += 0.01 * m.time_s
            speed[:, 2] += 0.1
            return Estimate(m.time_s, place, m["qx", "qy", "qz", "qw"], speed)

    case = one_case(flight)
    scored = task3.score(case, Drifting(), "clean")
    metrics, time_s = scored.metrics, scored.trajectory[:, 0]
    assert [metrics[f"velocity_{a}_rmse_m_s"] for a in "xyz"] == pytest.approx([0.0, 0.0, 0.1])
    assert [metrics[f"velocity_{a}_mean_m_s"] for a in "xyz"] == pytest.approx([0.0, 0.0, 0.1])
    length = time_s[-1] - time_s[0]
    middles = [time_s[0] + length * (k + 0.5) / 10.0 for k in range(10)]
    found = [metrics[f"error_until_{10 * (k + 1)}_percent_m"] for k in range(10)]
    assert found == pytest.approx([0.01 * t for t in middles], abs=2e-4)
    published = task3.score(one_case(flight, protocol="as-published"), EKF, "as-published").metrics
    assert "velocity_x_rmse_m_s" not in published


def test_a_perfect_estimator_scores_zero():
    flight = made_flight()

    class Perfect:
        name, causal = "perfect", False

        def estimate(self, given):
            m = flight["mocap"]
            return Estimate(m.time_s, m["px", "py", "pz"], -m["qx", "qy", "qz", "qw"], m["vx", "vy", "vz"])

    metrics = task3.score(one_case(flight), Perfect(), "clean").metrics
    for name in ("ate_unaligned_rmse_m", "rte_1m_m", "velocity_rmse_m_s", "drift_percent", "along_track_rmse_m"):
        assert metrics[name] == 0.0, name
    for name in ("ate_rmse_m", "rte_1m_start_frame_m", "attitude_geodesic_rmse_deg"):
        assert metrics[name] < 1e-12, name  # the quaternion was normalised anew, the points were aligned


def test_own_stamps_are_scored_and_outside_ones_counted():
    flight = made_flight()
    t = np.arange(-0.5, 30.0, 0.0137)

    class Slow:
        name, causal = "slow", True

        def estimate(self, given):
            q = so3.from_euler_zyx(0.05 * np.sin(t), 0.05 * np.cos(t), 0.02 * t)
            return Estimate(t, circle(t - 0.5), q)

    value = task3.score(one_case(flight), Slow(), "clean")
    assert value.metrics["ate_unaligned_rmse_m"] < 3e-3
    assert np.isnan(value.metrics["velocity_rmse_m_s"])
    assert value.rows == pytest.approx(20.1 / 0.0137, abs=3)  # without the 0.5 s given
    assert value.dropped == 0  # those outside the flight are not asked for
    assert value.trajectory.shape == (value.rows, 8)


def test_streams_with_other_stamps_are_interpolated():
    flight = made_flight()
    q = flight["attitude_qw"]
    shifted = flight.with_streams(attitude_qw=make_stream("attitude_qw", q.time_s[::2] + 0.003, q.values[::2],
                                                          q.quantities))
    metrics = task3.score(one_case(shifted), EKF, "clean").metrics
    assert metrics["attitude_geodesic_rmse_deg"] < 0.05


@pytest.mark.real
def test_scores_agree_with_evo_on_a_real_flight(real_data, audits_of):
    from evo.core import metrics
    from evo.core.trajectory import PoseTrajectory3D

    flights = load_recordings([real_data / "nanobench" / "datasets" / "dataset" / "B7_oval_slow_rep2.csv.xz"]).flights
    case = task3.select(flights, audits_of(flights), "clean")[0]
    value = task3.score(case, EKF, "clean")
    t, p, q = value.trajectory[:, 0], value.trajectory[:, 1:4], value.trajectory[:, 4:]
    mocap = flights[0]["mocap"]
    rows = np.searchsorted(mocap.time_s, t)
    truth = PoseTrajectory3D(mocap["px", "py", "pz"][rows], np.roll(mocap["qx", "qy", "qz", "qw"][rows], 1, axis=1), t)
    estimate = PoseTrajectory3D(p, np.roll(q, 1, axis=1), t)
    estimate.align(truth)
    ape = metrics.APE(metrics.PoseRelation.translation_part)
    ape.process_data((truth, estimate))
    assert value.metrics["ate_rmse_m"] == pytest.approx(ape.get_statistic(metrics.StatisticsType.rmse), rel=1e-9)
    assert value.metrics["ate_unaligned_rmse_m"] == pytest.approx(
        trajectory.ate(p, mocap["px", "py", "pz"][rows], "none").rmse_m)
