"""Ratios of rows: paired by flight and window, against hand-worked cases."""

import doctest
from types import SimpleNamespace

import numpy as np
import pytest

from nanobench_tools.metrics.prediction import QUANTITIES
from nanobench_tools.protocols import compare
from nanobench_tools.protocols.gate import GateRow
from nanobench_tools.protocols.result_rows import EndError, EstimateRow, FlightScore, WindowScore
from nanobench_tools.protocols.sessions import Drawn, Sessions
from nanobench_tools.protocols.task1 import PredictionRow, WindowErrors
from nanobench_tools.results.result import to_json

DAY, DATE = 86400.0, 1.7e9


def test_the_examples_in_the_docstrings_hold():
    assert doctest.testmod(compare).failed == 0


def test_methods_are_compared_with_the_best_kept_one_or_the_first():
    assert compare.reference(["a", "b"]) == "a"
    assert compare.reference(["a", "drag_matrix_ekf", "b"]) == "drag_matrix_ekf"
    assert compare.reference(["a", "a"]) is None


def many(factor, seed=0):
    rng = np.random.default_rng(seed)
    base = np.random.default_rng(9).gamma(1.0, size=30)
    return {f"f{i}": {"ate_rmse_m": factor * b * rng.normal(1.0, 0.05), "nees": 3.0, "z_bias_m": b - 1.0, "nan_m": None}
            for i, b in enumerate(base)}


LABELS = {f"f{i}": i // 5 for i in range(30)}


def row(method, protocol="clean", clock="as-recorded", flights=tuple(LABELS), inputs="all"):
    return EstimateRow(protocol=protocol, method=method, causal=True, group="all", n=len(flights), flights=flights,
                       given="all", inputs=inputs, drawn=Drawn(1, {}), metrics={}, clock=clock)


def test_a_row_says_its_ratio_to_another_and_how_sure_it_is():
    rows = [row(name) for name in ("first", "less", "same")]
    first, less, same = compare.methods(rows, {"first": many(1.0), "less": many(0.8, 1), "same": many(1.0, 2)}, LABELS)
    assert first.ratios is None
    assert less.ratios.to == to_json(less)["ratio_to"] == "first"
    assert set(less.ratios.ratio) == {"ate_rmse_m"}  # no ratio of biases, of consistency, or of what is not there
    assert less.ratios.ratio["ate_rmse_m"] == pytest.approx(0.8, abs=0.03)
    assert less.ratios.ci95["ate_rmse_m"][1] < 1.0
    low, high = same.ratios.ci95["ate_rmse_m"]
    assert low < 1.0 < high
    assert len(repr(less)) < 400


def test_methods_that_were_given_different_poses_are_not_compared():
    rows = [row("logged", inputs="all poses"), row("first"), row("second")]
    logged, first, second = compare.methods(rows, {m: many(f) for m, f in (("logged", 0.1), ("first", 1.0),
                                                                          ("second", 2.0))}, LABELS)
    assert (logged.ratios, first.ratios, second.ratios.to) == (None, None, "first")


def test_a_ratio_counts_the_flights_that_both_scored():
    rows = [row("a"), row("b", flights=("f0", "f1", "f2"))]
    ours = {"f0": {"x_m": 1.0}, "f1": {"x_m": 3.0}, "f2": {"x_m": 100.0}}
    _, one = compare.methods(rows, {"a": {"f0": {"x_m": 2.0}, "f1": {"x_m": 6.0}}, "b": ours}, LABELS)
    assert one.ratios.ratio == {"x_m": 0.5}
    assert one.ratios.ci95 == {"x_m": None}  # both of one session
    _, one = compare.methods(rows, {"a": {}, "b": ours}, LABELS)
    assert one.ratios.ratio == {}


def window(clock, flight, t0_s, h_s, error_m):
    return WindowScore(flight, "m", clock, EndError(t0_s, h_s, [0.0] * 3, error_m, error_m, 0.0, 1.0, None))


def test_clocks_are_compared_over_windows_that_both_have():
    windows = [window("as-recorded", "f0", 5.0, 1.0, 2.0), window("as-recorded", "f0", 10.0, 1.0, 100.0),
               window("as-recorded", "f9", 5.0, 1.0, 4.0), window("retimed", "f0", 5.01, 1.0, 1.0),
               window("retimed", "f0", 5.01, 5.0, 50.0), window("retimed", "f9", 4.99, 1.0, 2.0)]
    flights = [FlightScore("clean", "m", name, None, clock, {}, {"ate_rmse_m": value})
               for name in ("f0", "f9") for clock, value in (("as-recorded", 4.0), ("retimed", 1.0))]
    rows = [row("m", protocol, clock, ("f0", "f9"))
            for protocol in ("blackout", "clean") for clock in ("as-recorded", "retimed")]
    rows = compare.clocks(rows, flights, windows, "as-recorded", LABELS)
    assert [one.clock_ratios and one.clock_ratios.to for one in rows] == [None, "as-recorded"] * 2
    assert rows[1].clock_ratios.ratio["end_error_1s_m"] == 0.5
    assert "end_error_5s_m" not in rows[1].clock_ratios.ratio
    assert to_json(rows[3])["clock_ratio"] == {"ate_rmse_m": 0.25}


def scored(factor, windows=range(1, 10), groups=("all", "seen")):
    def sums(n):
        return {name: [factor * n * (h + 1.0) for h in range(50)] for name in QUANTITIES}

    return [(SimpleNamespace(flight=SimpleNamespace(name=f"f{i}", epoch_s=DATE + i * DAY), groups=groups),
             WindowErrors(n, sums(n), {"battery below 3.3 V": WindowErrors(1, sums(1))}))
            for i, n in enumerate(windows)]


def prediction(model, group, clock=""):
    return PredictionRow(model=model, information="state", truth="onboard", group=group, n_windows=9, n_flights=9,
                         drawn=Drawn(9, {}), metrics={}, ci95={}, clock=clock)


def test_models_are_compared_with_the_best_over_the_same_windows():
    rows = [prediction(m, g) for m in ("best", "b") for g in ("all", "battery below 3.3 V")]
    found = {("best", "onboard"): scored(1.0), ("b", "onboard"): scored(3.0, range(2, 20, 2))}
    made = compare.predictions(rows, found, "best", Sessions(tuple(DATE + i * DAY for i in range(9))))
    assert made[0].ratios is None
    for one in made[2:]:
        assert one.ratios.to == "best"
        for name in QUANTITIES:
            assert one.ratios.ratio[name] == pytest.approx({"1": 3.0, "10": 3.0, "50": 3.0, "sum": 3.0})
            assert one.ratios.ci95[name]["sum"] == pytest.approx([3.0, 3.0])
        assert len(repr(one)) < 400
    assert compare.predictions(rows, found, None, Sessions()) == rows


def test_models_are_compared_with_themselves_as_recorded():
    """Half the error on the other clock, over the flights that both clocks have; a flight counts as often as it has
    windows as recorded."""
    def found(factor, windows, clock):
        return compare.flight_means({("m", "onboard"): scored(factor, windows)}, clock)

    entries = found(2.0, range(1, 10), "as-recorded") + found(1.0, range(9, 1, -1), "retimed")
    assert entries[0].metrics["rate_mae_rad_s"] == pytest.approx({"1": 2.0, "10": 20.0, "50": 100.0, "sum": 2550.0})
    rows = [prediction("m", group, clock) for clock in ("as-recorded", "retimed") for group in ("all", "elsewhere")]
    rows = compare.prediction_clocks(rows, entries, "as-recorded", LABELS)
    assert [one.clock_ratios is not None for one in rows] == [False, False, True, False]
    found = rows[2].clock_ratios
    assert found.to == "as-recorded"
    for name in QUANTITIES:
        assert found.ratio[name] == pytest.approx(dict.fromkeys(("1", "10", "50", "sum"), 0.5))
        assert found.ci95[name]["50"] == pytest.approx([0.5, 0.5])


def test_gates_are_compared_over_the_same_flights():
    def row(name, gap, lag, ratio, passes):
        return GateRow(name, "pid", 9.0, False, 0.1, 0.1 * ratio, ratio, 0.0, lag, lag, gap, *[0.0] * 4, None, {},
                       passes)

    recorded = [row("f0", 0.04, -0.04, 1.2, False), row("f9", 0.08, 0.04, 0.8, False), row("f5", 9.0, 9.0, 9.0, False)]
    moved = [row("f9", 0.03, 0.01, 1.1, True), row("f0", 0.03, -0.01, 0.9, False)]
    found = compare.gates(moved, recorded, LABELS)
    assert {name: one.paired.ratio for name, one in found.items()} == pytest.approx(
        {"path_gap_m": 0.5, "lag_off_s": 0.25, "rmse_ratio_off": 0.5, "failed_share": 0.5})
    assert {one.paired.n for one in found.values()} == {2}
    gap = found["path_gap_m"]
    assert gap.mean == pytest.approx(gap.paired.ratio * gap.mean_recorded)
    assert list(to_json(gap)) == ["ratio", "ci95", "n", "ci_why", "mean", "mean_recorded"]
    assert compare.gates([], recorded, LABELS) == {}
