"""What an error comes from, dead logs and three standard deviations, on flights whose answers are known beforehand."""

from dataclasses import replace

import numpy as np
import pytest
from made_flights import END_S, dead, made_flight, verdict

from estimators.drag_ekf import DragEkf, DragMatrixEkf
from estimators.firmware_ekf import FirmwareEkf
from nanobench_tools.flight import Span
from nanobench_tools.methods import Estimate
from nanobench_tools.protocols import attribution, bands, task3
from nanobench_tools.protocols.aided import Aiding
from nanobench_tools.protocols.dead_logs import dead_logs
from nanobench_tools.protocols.result_rows import BlackoutScore, EndError, Scored


def case_of(flight, *faults, protocol="clean"):
    return task3.select([flight], {flight.name: verdict(flight, *faults)}, protocol)[0]


@pytest.mark.slow
def test_a_late_clock_is_what_the_logged_error_comes_from():
    """The logged estimate is 40 ms late: with the stamps put right its error is gone; the replay never had it."""
    late, right = case_of(made_flight(late_s=0.04)), case_of(made_flight(late_s=0.0))
    found = attribution.tabulate({"as-recorded": [attribution.logged(late)], "retimed": [attribution.logged(right)]},
                                 [attribution.replays(attribution.Filters(FirmwareEkf, DragMatrixEkf()), right, right)])
    recorded, retimed = (row.metrics["along_m"].mean for row in found.logged)
    assert recorded > 0.015
    assert retimed < 1e-3
    rows = {row.what: row.metrics for row in found.replayed}
    assert list(rows) == list(attribution.REPLAYS)
    assert rows[attribution.BASE]["change_m"].mean == rows[attribution.BASE]["moves_m"].mean == 0.0
    assert rows["IMU as recorded (telemetry clock)"]["moves_m"].mean == 0.0  # both cases are the same recording
    assert rows["poses 20 ms late"]["moves_m"].mean > 1e-3
    assert rows["process noise doubled (parameters)"]["moves_m"].mean > 0.0


def test_dead_logs_are_told_from_live_rows():
    flight = made_flight()
    said = flight["estimator"]
    values = said.values.copy()
    over = said.time_s > 15.0
    values[over, 0] += 3.0 * (said.time_s[over] - 15.0)
    flight = flight.with_streams(estimator=replace(said, values=values))
    audits = {flight.name: verdict(flight, dead("estimator", 15.0))}
    cases = task3.select([flight], audits, "as-published")
    found = dead_logs(cases, audits)
    assert [one.flight for one in found] == [flight.name]
    one = found[0]
    assert one.all_rmse_m > 50.0 * one.live_rmse_m
    assert one.dead[0][0] == 15.0
    assert one.dead[0][1] <= END_S
    assert len(one.t_s) == len(one.error_m) <= 300
    assert dead_logs(cases, {flight.name: verdict(flight)}) == []


class Sure:
    """10 mm off along x, and says so."""

    name, causal = "sure", True

    def estimate(self, given):
        t = given["imu"].time_s
        n = len(t)
        covariance = np.tile(np.diag([1e-4, 4e-4, 9e-4]), (n, 1, 1))
        covariance[:, 0, 1] = covariance[:, 1, 0] = 5e-5
        level = np.tile([0.0, 0.0, 0.0, 1.0], (n, 1))
        return Estimate(t, self.truth(t) + np.array([0.01, 0.0, 0.0]), level, None, covariance)

    def __init__(self, flight):
        mocap = flight["mocap"]
        self.truth = lambda t: np.stack([np.interp(t, mocap.time_s, mocap[c]) for c in ("px", "py", "pz")], axis=1)


def test_a_band_holds_error_and_sd_by_axis():
    flight = made_flight()
    case = case_of(flight)
    band = bands.aided_band(case, Sure(flight), Aiding(), 0).band
    assert len(band.t_s) == bands.ROWS
    assert np.array(band.error_m) == pytest.approx(np.tile([0.01, 0.0, 0.0], (bands.ROWS, 1)), abs=1e-4)
    assert np.array(band.sd_m)[7] == pytest.approx([0.01, 0.02, 0.03])
    assert band.cov_xy_m2[0] == pytest.approx(5e-5)
    later = bands.blackout_band(case, Sure(flight), 8.0, 5.0).band
    assert (later.t_s[0], later.t_s[-1]) == pytest.approx((0.0, 5.0), abs=0.011)
    plain = Estimate(np.array([0.0, 1.0]), np.zeros((2, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (2, 1)))
    assert bands.band_of(case, plain, [Span(0.0, 1.0)]) is None


def test_the_median_flight_and_window_are_drawn():
    cases = [case_of(made_flight(name)) for name in "abc"]
    scored = [(case, Scored({"ate_rmse_m": ate, "nees": 3.0}, 100, 0))
              for case, ate in zip(cases, (3.0, 1.0, 2.0), strict=True)]
    assert bands.median_case(scored).flight.name == "c"
    assert bands.median_case([(case, Scored({"ate_rmse_m": 1.0}, 100, 0)) for case in cases]) is None
    windows = [EndError(t0, h, [0.0] * 3, e, e, 0.0, 1.0, True)
               for h, t0, e in ((1.0, 5.0, 0.1), (5.0, 5.0, 0.9), (5.0, 10.0, 0.3), (5.0, 15.0, 0.5))]
    assert bands.median_window([(cases[0], BlackoutScore(windows, {}))])[1:] == (15.0, 5.0)
    silent = [replace(window, inside_3_sigma=None) for window in windows]
    assert bands.median_window([(cases[0], BlackoutScore(silent, {}))]) is None


def test_a_filter_has_one(crowd):
    """SYNTHETIC: what a filter says of itself on a practice flight holds its error most of the time."""
    from nanobench_tools.auditing.recording_audit import audit

    flight = crowd.flight("short circle")
    case = task3.select([flight], {flight.name: audit(flight)}, "clean")[0]
    band = bands.aided_band(case, DragEkf(), Aiding(), 0).band
    inside = np.abs(band.error_m) <= 3.0 * np.array(band.sd_m)
    assert inside.mean() > 0.9
