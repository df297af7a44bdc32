"""Task 3: what is given, what is scored, and the published and corrected tables on the real recordings."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fifteen import FIFTEEN
from made_flights import circle, cut, dead, made_flight, verdict

from estimators.constant_velocity import ConstantVelocity
from estimators.hold_position import HoldPosition
from estimators.onboard_ekf import OnboardEkf
from nanobench_tools import Estimate, InputError, UsageError, so3
from nanobench_tools.auditing.verb_needs import ESTIMATE
from nanobench_tools.flight import Flight, Provenance, Span, make_stream
from nanobench_tools.metrics import trajectory
from nanobench_tools.protocols import task3
from nanobench_tools.protocols.published import published
from nanobench_tools.protocols.trajectories import write_tum
from nanobench_tools.results.result import to_json
from nanobench_tools.sources.discover import load_recordings
from nanobench_tools.sources.labels import OTHER_FAMILIES
from nanobench_tools.sources.trajectory_file import TrajectoryFile

EKF = OnboardEkf()


def one_case(flight, *faults, protocol="clean"):
    return task3.select([flight], {flight.name: verdict(flight, *faults)}, protocol)[0]


def table(flights, audits, protocol, method=EKF):
    """Rows by group."""
    cases = task3.select(flights, audits, protocol)
    return {row.group: row for row in task3.tabulate(protocol, method, [
        (case, task3.score(case, method, protocol)) for case in cases])}


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


def test_a_stopped_log_is_cut():
    flight = made_flight()
    m = flight["estimator"]
    broken = m.values.copy()
    broken[1500:] += np.arange(len(m) - 1500)[:, None] * 0.01
    wrong = flight.with_streams(estimator=replace(m, values=broken))
    assert task3.score(one_case(wrong), EKF, "clean").metrics["ate_unaligned_rmse_m"] > 1.0
    case = one_case(wrong, dead("estimator", 14.99))
    value = task3.score(case, EKF, "clean")
    assert value.metrics["ate_unaligned_rmse_m"] < 0.04
    assert value.trajectory[-1, 0] <= 15.0


def test_faults_of_the_estimate_itself_are_not_cut():
    flight = made_flight()
    jump = replace(dead("estimator", 10.0, 12.0), kind="estimator_reset")
    assert one_case(flight, jump).spans == one_case(flight).spans
    hidden = replace(dead("mocap", 10.0, 12.0), kind="mocap_occlusion")
    assert len(one_case(flight, hidden).spans) == 2


def test_what_an_estimator_is_given():
    flight = made_flight()
    case = one_case(flight, dead("imu", 18.0))
    given = task3.given_to(replace(case, spans=(Span(3.0, 18.0),)))
    assert given["mocap"].quantities == task3.POSE
    assert given["mocap"].span.end_s == pytest.approx(3.5)
    assert given["imu"].span.end_s == pytest.approx(18.0)
    assert given.span.end_s == pytest.approx(18.0)


@pytest.mark.parametrize("method", [HoldPosition(), ConstantVelocity()])
def test_bending_the_truth_after_the_given_part_changes_no_estimate(method):
    flight = made_flight()
    mocap = flight["mocap"]
    bent = mocap.values.copy()
    bent[mocap.time_s > 3.8] += 5.0
    other = flight.with_streams(mocap=replace(mocap, values=bent))
    a, b = (method.estimate(task3.given_to(one_case(f))) for f in (flight, other))
    assert np.array_equal(a.position_m, b.position_m)
    assert np.array_equal(a.quaternion, b.quaternion)


def test_the_floors_do_what_they_say():
    flight = made_flight()
    given = task3.given_to(one_case(flight))
    held, straight = HoldPosition().estimate(given), ConstantVelocity().estimate(given)
    last = given["mocap"].span.end_s
    later = held.time_s > last
    assert np.ptp(held.position_m[later], axis=0) == pytest.approx([0, 0, 0])
    climbing = straight.position_m[later][:, 2]
    assert np.diff(climbing) == pytest.approx(0.005, abs=2e-4)  # it was climbing at 0.5 m/s


class From:
    """What ``make`` of the flight given."""

    name, causal = "mine", False

    def __init__(self, make):
        self.make = make

    def estimate(self, flight):
        return self.make(flight)


def poses(mocap, rows=slice(None), off_m=0.0):
    return Estimate(mocap.time_s[rows], mocap["px", "py", "pz"][rows] + off_m, mocap["qx", "qy", "qz", "qw"][rows])


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


class PretendsToBeLogged(OnboardEkf):
    """Gives back whatever motion capture it gets and calls itself logged in flight."""

    def __init__(self):
        self.seen = []

    def estimate(self, flight):
        self.seen.append(flight)
        return poses(flight["mocap"])

    def logged_euler(self, flight):
        self.seen.append(flight)
        return flight["mocap"]["roll", "pitch", "yaw"]


class Watched(OnboardEkf):
    def estimate(self, flight):
        assert "mocap" not in flight
        return super().estimate(flight)

    def logged_euler(self, flight):
        assert "mocap" not in flight
        return super().logged_euler(flight)


@pytest.mark.parametrize("protocol", task3.PROTOCOLS)
def test_who_calls_itself_logged_sees_no_more_than_others(protocol):
    flight = made_flight()
    case = one_case(flight, protocol=protocol)
    cheat = PretendsToBeLogged()
    with pytest.raises(InputError, match=r"covers 0\.0 % of it"):
        task3.score(case, cheat, protocol)
    for seen in cheat.seen:
        assert seen["mocap"].quantities == task3.POSE
        assert seen["mocap"].span.end_s <= case.spans[0].start_s + task3.GIVEN_S
    mocap = flight["mocap"]
    cheat.estimate = lambda given: poses(mocap)
    row = task3.tabulate(protocol, cheat, [(case, task3.score(case, cheat, protocol))])[0]
    assert row.given.startswith(task3.GIVEN)
    assert row.published is None


@pytest.mark.parametrize("protocol", task3.PROTOCOLS)
def test_what_was_logged_is_scored_without_any_motion_capture(protocol, monkeypatch):
    case = one_case(made_flight(), protocol=protocol)
    expected = task3.score(case, EKF, protocol)
    monkeypatch.setattr(task3, "OnboardEkf", Watched)
    found = task3.score(case, Watched(), protocol)
    assert found.metrics == pytest.approx(expected.metrics, nan_ok=True)
    assert found.rows == expected.rows


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


def test_unknown_protocols_list_the_known_ones():
    with pytest.raises(UsageError, match="as-published, as-published-corrected, clean"):
        task3.select([], {}, "nonsense")


def test_nothing_to_score_names_the_place():
    bare = made_flight().without_streams("mocap")
    with pytest.raises(InputError, match=r"made\.csv: no flight for protocol .clean."):
        task3.select([bare], {bare.name: verdict(bare)}, "clean")


def test_what_recordings_lack_is_counted():
    bare = [made_flight(name).without_streams(lacks) for name, lacks in zip("abc", ("estimator", "estimator", "motor"),
                                                                            strict=True)]
    with pytest.raises(InputError, match=r"no estimator stream in 2; no motor stream in 1; it needs motion capture"):
        task3.select(bare, {f.name: verdict(f) for f in bare}, "clean", ESTIMATE)


def test_slices_count_once_in_clean_and_alone_when_alone():
    whole = made_flight("whole")
    piece = cut(whole, 2.5, 15.0)
    audits = {f.name: verdict(f) for f in (whole, piece)}
    rows = table([whole, piece], audits, "clean")
    assert rows["all"].flights == ["whole"]
    assert "1 copies and slices left out" in rows["all"].given
    alone = table([piece], audits, "clean")
    assert alone["all"].flights == ["piece"]
    assert set(alone) == {"all", "slow", "circle", "slow/circle"}


def test_as_published_without_cut_pieces_says_so():
    whole = made_flight("whole")
    rows = table([whole], {"whole": verdict(whole)}, "as-published")
    assert set(rows) == {"Slow"}
    assert "motor 1 above 1000 of all recordings" in rows["Slow"].given
    assert rows["Slow"].published is None


def test_streams_with_other_stamps_are_interpolated():
    flight = made_flight()
    q = flight["attitude_qw"]
    shifted = flight.with_streams(attitude_qw=make_stream("attitude_qw", q.time_s[::2] + 0.003, q.values[::2],
                                                          q.quantities))
    metrics = task3.score(one_case(shifted), EKF, "clean").metrics
    assert metrics["attitude_geodesic_rmse_deg"] < 0.05


CORRECTED = {  # means and SD over flights: n, ATE RMSE, ATE mean, RTE mm, velocity m/s, attitude deg, unaligned mm
    "Slow": (11, (21.1, 3.3), (16.5, 3.2), (28.2, 6.8), (0.069, 0.015), (1.04, 0.36), (23.4, 4.5)),
    "Medium": (8, (21.3, 2.0), (17.2, 1.5), (30.4, 3.1), (0.067, 0.010), (0.97, 0.38), (24.4, 2.6)),
    "Fast": (7, (42.1, 6.0), (33.5, 5.9), (57.7, 14.2), (0.152, 0.033), (1.84, 0.45), (47.9, 8.6))}
METRICS = (("ate_rmse_m", 1e3, 0.06), ("ate_mean_m", 1e3, 0.06), ("rte_1m_m", 1e3, 0.06),
           ("velocity_rmse_m_s", 1.0, 6e-4), ("attitude_rmse_deg", 1.0, 6e-3), ("ate_unaligned_rmse_m", 1e3, 0.06))


def assert_published(rows):
    printed = published()["task3"]["groups"]
    digits = {"ate_rmse_m": 4, "ate_mean_m": 4, "rte_1m_m": 4, "velocity_rmse_m_s": 3, "attitude_rmse_deg": 2}
    assert list(rows) == ["Slow", "Medium", "Fast"]
    for group, row in rows.items():
        assert row.n == printed[group]["n"]
        for metric, places in digits.items():
            for key in ("mean", "std"):
                assert f"{getattr(row.metrics[metric], key):.{places}f}" == f"{printed[group][metric][key]:.{places}f}"
        assert to_json(row.published.published["ate_rmse_m"]) == printed[group]["ate_rmse_m"]


def assert_corrected(rows):
    for group, (n, *values) in CORRECTED.items():
        assert rows[group].n == n
        for (metric, factor, tolerance), (mean, std) in zip(METRICS, values, strict=True):
            found = rows[group].metrics[metric]
            assert factor * found.mean == pytest.approx(mean, abs=tolerance), (group, metric)
            assert factor * found.std == pytest.approx(std, abs=tolerance), (group, metric)


@pytest.mark.real
def test_the_published_table_to_every_printed_digit(real):
    assert_published(table(*real, "as-published"))


@pytest.mark.slow
@pytest.mark.real
def test_the_corrected_table(real):
    assert_corrected(table(*real, "as-published-corrected"))


@pytest.mark.slow
@pytest.mark.real
def test_both_tables_from_the_slices_alone_under_other_names_without_sheets(real_data, audits_of, tmp_path):
    files = sorted((real_data / "nanobench" / "benchmarks" / "task3_stateEst").rglob("*.csv.xz"))
    for i, path in enumerate(np.random.default_rng(0).permutation([os.fspath(f) for f in files])):
        (tmp_path / f"x{i}").symlink_to(path)
    flights = load_recordings([tmp_path]).flights
    assert not any(flight.metadata.get("trajectory_id") for flight in flights)
    audits = audits_of(flights)
    assert_published(table(flights, audits, "as-published"))
    assert_corrected(table(flights, audits, "as-published-corrected"))


@pytest.mark.real
@pytest.mark.slow
def test_the_clean_protocol_on_a_few_trefoils(real):
    """An estimate that is late along the path; as few recordings do, errors scatter about those of all."""
    flights, audits = real
    paths = {f.name: Path(f.provenance.path) for f in flights}  # names of copies elsewhere hold their folder, too
    few = [f for f in flights if paths[f.name].parent.name == "dataset" and f.metadata.get("family") == "trefoil"
           and paths[f.name].name.partition(".")[0] in FIFTEEN]
    rows = table(few, audits, "clean")
    assert (rows["medium/trefoil"].n, rows["fast/trefoil"].n) == (3, 3)
    assert 1e3 * rows["medium/trefoil"].metrics["ate_rmse_m"].mean == pytest.approx(21.0, rel=0.15)
    assert 1e3 * rows["fast/trefoil"].metrics["ate_rmse_m"].mean == pytest.approx(39.4, rel=0.15)
    late = rows["all"].metrics
    assert 0.0 < late["delay_s"].median < 0.05
    assert late["across_track_delay_removed_rmse_m"].median < 2e-3
    assert late["along_track_delay_removed_rmse_m"].median > 0.01


def assert_late(metrics):
    assert metrics["delay_s"].median == pytest.approx(0.0205, abs=0.006)
    assert metrics["across_track_delay_removed_rmse_m"].median < 1.5e-3
    assert metrics["along_track_delay_removed_rmse_m"].median > 0.015


@pytest.mark.slow
@pytest.mark.real
def test_the_clean_protocol_on_trefoils(real):
    flights, audits = real
    trefoils = [f for f in flights if f.metadata.get("family") == "trefoil"]
    rows = table(trefoils, audits, "clean")
    for group, n, ate_mm, attitude_deg in (("slow/trefoil", 12, 20.1, 1.04), ("medium/trefoil", 8, 21.0, 0.99),
                                           ("fast/trefoil", 9, 39.4, 1.75)):
        # The reference is for rows with motor 1 above 1000; airborne rows leave the ground out, where errors are small.
        assert rows[group].n == n
        assert 1e3 * rows[group].metrics["ate_rmse_m"].mean == pytest.approx(ate_mm, rel=0.04)
        assert rows[group].metrics["attitude_rmse_deg"].mean == pytest.approx(attitude_deg, rel=0.04)
    assert_late(rows["all"].metrics)


@pytest.mark.real
def test_scores_agree_with_evo_on_a_real_flight(real):
    from evo.core import metrics
    from evo.core.trajectory import PoseTrajectory3D

    flights, audits = real
    flight = next(f for f in flights if f.metadata.get("family") == "lissajous")
    case = task3.select([flight], audits, "clean")[0]
    value = task3.score(case, EKF, "clean")
    t, p, q = value.trajectory[:, 0], value.trajectory[:, 1:4], value.trajectory[:, 4:]
    mocap = flight["mocap"]
    rows = np.searchsorted(mocap.time_s, t)
    truth = PoseTrajectory3D(mocap["px", "py", "pz"][rows], np.roll(mocap["qx", "qy", "qz", "qw"][rows], 1, axis=1), t)
    estimate = PoseTrajectory3D(p, np.roll(q, 1, axis=1), t)
    estimate.align(truth)
    ape = metrics.APE(metrics.PoseRelation.translation_part)
    ape.process_data((truth, estimate))
    assert value.metrics["ate_rmse_m"] == pytest.approx(ape.get_statistic(metrics.StatisticsType.rmse), rel=1e-9)
    assert value.metrics["ate_unaligned_rmse_m"] == pytest.approx(
        trajectory.ate(p, mocap["px", "py", "pz"][rows], "none").rmse_m)


@pytest.mark.parametrize(("families", "apart"), [
    (("circle", "star", "trefoil", "oval"), (False, True, False, True)),
    (("star", "oval"), (False, False)),  # nobody's numbers were set here: the group would be all of them again
    (("circle", "trefoil"), (False, False)),
])
def test_families_that_set_nothing_of_the_filters_are_a_group(families, apart):
    provenance = Provenance("made", "", "test", synthetic=True)
    cases = [task3.Case(Flight(name, {}, {"family": name}, provenance), (), ("all",)) for name in families]
    assert tuple(OTHER_FAMILIES in case.groups for case in task3._apart(cases)) == apart
    assert all(case.groups[0] == "all" for case in task3._apart(cases))
