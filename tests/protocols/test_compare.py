"""Ratios of rows: paired by flight and window, against hand-worked cases."""

import doctest
from types import SimpleNamespace

import numpy as np
import pytest

from nanobench_tools.metrics.prediction import QUANTITIES
from nanobench_tools.protocols import compare
from nanobench_tools.protocols.sessions import Sessions

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


def test_a_row_says_its_ratio_to_another_and_how_sure_it_is():
    rows = [{"method": name, "flights": list(LABELS)} for name in ("first", "less", "same")]
    compare.methods(rows, {"first": many(1.0), "less": many(0.8, 1), "same": many(1.0, 2)}, LABELS)
    first, less, same = rows
    assert "ratio_to" not in first
    assert less["ratio_to"] == "first"
    assert set(less["ratio"]) == {"ate_rmse_m"}  # no ratio of biases, of consistency, or of what is not there
    assert less["ratio"]["ate_rmse_m"] == pytest.approx(0.8, abs=0.03)
    assert less["ratio_ci95"]["ate_rmse_m"][1] < 1.0
    low, high = same["ratio_ci95"]["ate_rmse_m"]
    assert low < 1.0 < high


def test_a_ratio_counts_the_flights_that_both_scored():
    row = {"method": "b", "flights": ["f0", "f1", "f2"]}
    ours = {"f0": {"x_m": 1.0}, "f1": {"x_m": 3.0}, "f2": {"x_m": 100.0}}
    compare.methods([row], {"a": {"f0": {"x_m": 2.0}, "f1": {"x_m": 6.0}}, "b": ours}, LABELS)
    assert row["ratio"] == {"x_m": 0.5}
    assert row["ratio_ci95"] == {"x_m": None}  # both of one session
    compare.methods([row], {"a": {}, "b": ours}, LABELS)
    assert row["ratio"] == {}


def window(clock, flight, t0_s, h_s, error_m):
    return {"method": "m", "clock": clock, "flight": flight, "t0_s": t0_s, "h_s": h_s, "error_m": error_m,
            "horizontal_m": error_m, "vertical_m": 0.0}


def test_clocks_are_compared_over_windows_that_both_have():
    windows = [window("as-recorded", "f0", 5.0, 1.0, 2.0), window("as-recorded", "f0", 10.0, 1.0, 100.0),
               window("as-recorded", "f9", 5.0, 1.0, 4.0), window("retimed", "f0", 5.01, 1.0, 1.0),
               window("retimed", "f0", 5.01, 5.0, 50.0), window("retimed", "f9", 4.99, 1.0, 2.0)]
    flights = [{"protocol": "clean", "method": "m", "flight": name, "clock": clock, "metrics": {"ate_rmse_m": value}}
               for name in ("f0", "f9") for clock, value in (("as-recorded", 4.0), ("retimed", 1.0))]
    rows = [{"protocol": protocol, "method": "m", "clock": clock, "flights": ["f0", "f9"]}
            for protocol in ("blackout", "clean") for clock in ("as-recorded", "retimed")]
    compare.clocks({"rows": rows, "windows": windows, "per_flight": flights}, "as-recorded", LABELS)
    assert [row.get("clock_ratio_to") for row in rows] == [None, "as-recorded"] * 2
    assert rows[1]["clock_ratio"]["end_error_1s_m"] == 0.5
    assert "end_error_5s_m" not in rows[1]["clock_ratio"]
    assert rows[3]["clock_ratio"] == {"ate_rmse_m": 0.25}


def scored(factor, windows=range(1, 10), groups=("all", "seen")):
    def sums(n):
        return {name: [factor * n * (h + 1.0) for h in range(50)] for name in QUANTITIES}

    return [(SimpleNamespace(flight=SimpleNamespace(name=f"f{i}", epoch_s=DATE + i * DAY), groups=groups),
             {"windows": n, "sums": sums(n), "battery": {"battery below 3.3 V": {"windows": 1, "sums": sums(1)}}})
            for i, n in enumerate(windows)]


def test_models_are_compared_with_the_best_over_the_same_windows():
    rows = [{"model": m, "truth": "onboard", "group": g} for m in ("best", "b") for g in ("all", "battery below 3.3 V")]
    found = {("best", "onboard"): scored(1.0), ("b", "onboard"): scored(3.0, range(2, 20, 2))}
    compare.predictions(rows, found, "best", Sessions(tuple(DATE + i * DAY for i in range(9))))
    assert "ratio_to" not in rows[0]
    for row in rows[2:]:
        assert row["ratio_to"] == "best"
        for name in QUANTITIES:
            assert row["ratio"][name] == pytest.approx({"1": 3.0, "10": 3.0, "50": 3.0, "sum": 3.0})
            assert row["ratio_ci95"][name]["sum"] == pytest.approx([3.0, 3.0])
    nothing = [{"model": "b", "truth": "onboard", "group": "all"}]
    compare.predictions(nothing, found, None, Sessions())
    assert nothing == [{"model": "b", "truth": "onboard", "group": "all"}]


def test_models_are_compared_with_themselves_as_recorded():
    """Half the error on the other clock, over the flights that both clocks have; a flight counts as often as it has
    windows as recorded."""
    def found(factor, windows, clock):
        return compare.flight_means({("m", "onboard"): scored(factor, windows)}, clock)

    entries = found(2.0, range(1, 10), "as-recorded") + found(1.0, range(9, 1, -1), "retimed")
    assert entries[0]["metrics"]["rate_mae_rad_s"] == pytest.approx({"1": 2.0, "10": 20.0, "50": 100.0, "sum": 2550.0})
    rows = [{"model": "m", "truth": "onboard", "group": group, "clock": clock}
            for clock in ("as-recorded", "retimed") for group in ("all", "elsewhere")]
    compare.prediction_clocks({"rows": rows, "per_flight": entries}, "as-recorded", LABELS)
    assert ["clock_ratio" in row for row in rows] == [False, False, True, False]
    assert rows[2]["clock_ratio_to"] == "as-recorded"
    for name in QUANTITIES:
        assert rows[2]["clock_ratio"][name] == pytest.approx(dict.fromkeys(("1", "10", "50", "sum"), 0.5))
        assert rows[2]["clock_ratio_ci95"][name]["50"] == pytest.approx([0.5, 0.5])


def test_gates_are_compared_over_the_same_flights():
    def row(name, gap, lag, ratio, passes):
        return {"flight": name, "path_gap_m": gap, "lag_diff_s": lag, "ratio": ratio, "pass": passes}

    recorded = [row("f0", 0.04, -0.04, 1.2, False), row("f9", 0.08, 0.04, 0.8, False), row("f5", 9.0, 9.0, 9.0, False)]
    moved = [row("f9", 0.03, 0.01, 1.1, True), row("f0", 0.03, -0.01, 0.9, False)]
    found = compare.gates(moved, recorded, LABELS)
    assert {name: one["ratio"] for name, one in found.items()} == pytest.approx(
        {"path_gap_m": 0.5, "lag_off_s": 0.25, "rmse_ratio_off": 0.5, "failed_share": 0.5})
    assert {one["n"] for one in found.values()} == {2}
    assert found["path_gap_m"]["mean"] == pytest.approx(
        found["path_gap_m"]["ratio"] * found["path_gap_m"]["mean_recorded"])
    assert compare.gates([], recorded, LABELS) == {}
