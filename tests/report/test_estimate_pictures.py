"""Pictures of Task 3: what is drawn of single estimates, dead logs and the attribution."""

from nanobench_tools.report import estimates


def band(method, name="10 Hz: a", clock="as-recorded"):
    return {"protocol": "aided", "name": name, "flight": "a", "method": method, "clock": clock, "t_s": [0.0, 1.0],
            "truth_m": [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]], "error_m": [[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]],
            "sd_m": [[0.01] * 3] * 2, "cov_xy_m2": [0.0, 1e-5]}


def test_bands_come_by_flight_and_method():
    found = estimates.bands({"bands": [band("one"), band("two"), band("one", clock="retimed")]})
    assert [(s["name"], [m["name"] for m in s["methods"]]) for s in found["sets"]] == [
        ("10 Hz: a", ["one", "two"]), ("10 Hz: a, clock retimed", ["one"])]
    assert found["sets"][0]["methods"][0]["error"] == {"x": [0.1, 0.4], "y": [0.2, 0.5], "z": [0.3, 0.6]}
    assert "absent" in estimates.bands({})


def test_dead_rows_and_live_rows_are_two_lines():
    flight = {"flight": "a", "speed": "fast", "t_s": [0.0, 1.0, 2.0], "error_m": [0.01, 0.02, 3.0],
              "dead": [[1.5, 2.0]], "live_rmse_m": 0.015, "all_rmse_m": 1.7}
    one = estimates.dead_logs({"dead_logs": [flight]})["flights"][0]
    assert (one["live"], one["dead"]) == ([10.0, 20.0, None], [None, None, 3000.0])
    assert (one["live_mm"], one["all_mm"]) == (15.0, 1700.0)
    assert "absent" in estimates.dead_logs({"dead_logs": []})


def test_attribution_bars_have_intervals():
    def summary(mean):
        return {"mean": mean, "std": 0.1, "median": mean, "p90": mean, "ci95": [mean - 1e-3, mean + 1e-3]}

    replayed = [{"what": what, "metrics": {"ate_m": summary(0.01), "change_m": summary(change)}}
                for what, change in (("base", 0.0), ("poses late", 0.004))]
    body = {"attribution": {"n": 9, "n_replayed": 8, "replayed": replayed,
                            "logged": [{"what": "retimed", "metrics": {"ate_m": summary(0.02)}}]}}
    found = estimates.attribution(body)
    assert [(bar["part"], bar["name"], round(bar["mm"], 6)) for bar in found["bars"]] == [
        (0, "logged, clock retimed", 20.0), (0, "base", 10.0), (1, "poses late", 4.0)]
    assert round(found["bars"][2]["low"], 6) == 3.0
    assert "absent" in estimates.attribution({})
