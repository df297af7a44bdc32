"""Pictures of Task 3: what is drawn of single estimates, dead logs and the attribution."""

import numpy as np
import pytest

from nanobench_tools.pages import estimate_figures, overview_pictures


def band(method, name="10 Hz: a", clock="as-recorded"):
    return {"protocol": "aided", "name": name, "flight": "a", "method": method, "clock": clock, "t_s": [0.0, 1.0],
            "truth_m": [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]], "error_m": [[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]],
            "sd_m": [[0.01] * 3] * 2, "cov_xy_m2": [0.0, 1e-5]}


def test_bands_come_by_flight_and_method():
    found = estimate_figures.bands({"bands": [band("one"), band("two"), band("one", clock="retimed")]})
    assert list(found.figures) == [("10 Hz: a", "one"), ("10 Hz: a", "two"), ("10 Hz: a, clock retimed", "one")]
    errors = [p.marks[1].y.tolist() for p in found.first.panels[1:]]
    np.testing.assert_allclose(errors, [[0.1, 0.4], [0.2, 0.5], [0.3, 0.6]], atol=3e-4)  # a step of the picture
    assert "inside for 0 % of this flight" in found.first.note
    assert estimate_figures.bands({}) is None


def test_an_ellipse_is_three_standard_deviations_along_its_axes():
    """Hand-worked: sd 3 and 1 turned by 45 degrees have variances 5 and 5 and covariance 4."""
    points = estimate_figures._ellipse(np.zeros(2), np.array([5.0, 5.0, 1.0]) ** 0.5, 4.0)
    away = np.linalg.norm(points, axis=1)
    assert (away.max(), away.min()) == (pytest.approx(9.0), pytest.approx(3.0))
    longest = points[np.argmax(away)]
    assert abs(longest[0]) == pytest.approx(abs(longest[1]))
    assert longest[0] * longest[1] > 0.0


def test_dead_rows_and_live_rows_are_two_lines():
    flight = {"flight": "a", "speed": "fast", "t_s": [0.0, 1.0, 2.0], "error_m": [0.01, 0.02, 3.0],
              "dead": [[1.5, 2.0]], "live_rmse_m": 0.015, "all_rmse_m": 1.7}
    (one,) = estimate_figures.dead_logs({"dead_logs": [flight]}).panels
    live, dead = (mark.y for mark in one.marks)
    assert live == pytest.approx([10.0, 20.0, np.nan], nan_ok=True)
    assert dead == pytest.approx([np.nan, np.nan, 3000.0], nan_ok=True)
    assert one.title == "a: 1700 mm RMS, 15 while the log lived"
    assert estimate_figures.dead_logs({"dead_logs": []}) is None


def test_attribution_bars_have_intervals():
    def summary(mean):
        return {"mean": mean, "std": 0.1, "median": mean, "p90": mean, "ci95": [mean - 1e-3, mean + 1e-3]}

    replayed = [{"what": what, "metrics": {"ate_m": summary(0.01), "change_m": summary(change)}}
                for what, change in (("base", 0.0), ("poses late", 0.004))]
    body = {"attribution": {"n": 9, "n_replayed": 8, "replayed": replayed,
                            "logged": [{"what": "retimed", "metrics": {"ate_m": summary(0.02)}}]}}
    above, below = estimate_figures.attribution(body).panels
    assert above.y.rows == ["logged, clock retimed", "base"]
    assert above.marks[0].x == pytest.approx([20.0, 10.0])
    assert (below.y.rows, below.marks[0].x) == (["poses late"], pytest.approx([4.0]))
    assert below.marks[0].low == pytest.approx([3.0])
    assert below.marks[0].across
    assert estimate_figures.attribution({}) is None


def test_error_over_progress_by_speed():
    def row(group, first, **more):
        metrics = {f"error_until_{k}_percent_m": {"mean": first * k, "std": 0.5 * first * k}
                   for k in range(10, 101, 10)}
        metrics |= {f"velocity_{a}_rmse_m_s": {"mean": 0.1 * (k + 1), "std": 0.0} for k, a in enumerate("xyz")}
        return {"protocol": "clean", "method": "onboard_ekf", "group": group, "metrics": metrics, "n": 3} | more

    rows = [row("all", 3.0), row("slow", 0.001), row("fast", 0.002), row("slow", 9.0, method="other"),
            row("slow", 9.0, protocol="aided")]
    drawing = overview_pictures.progress({"rows": rows})
    error, velocity = drawing.panels
    assert [mark.name for mark in error.marks] == ["slow", "fast"]
    assert error.marks[0].y == pytest.approx([float(k) for k in range(10, 101, 10)])
    assert error.marks[1].high == pytest.approx([3.0 * k for k in range(10, 101, 10)])
    assert velocity.marks[0].y == pytest.approx([0.1, 0.2, 0.3])
    assert overview_pictures.progress({"rows": rows[3:4]}).panels
    assert overview_pictures.progress({"rows": []}) is None
