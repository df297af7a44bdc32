"""The screen of Task 1."""

from nanobench_tools.pages.sysid_tables import sysid_screen
from nanobench_tools.tables.terminal import lines_of

METRICS = ("position_mae_m", "velocity_mae_m_s", "attitude_mae_rad", "rate_mae_rad_s")


def test_the_best_model_is_the_first_row():
    rows = [{"group": "all", "model": name, "information": "state", "truth": "onboard",
             "ci95": {"position_mae_m": {}}, "metrics": {metric: {"50": 0.1} for metric in METRICS}}
            for name in ("naive", "published_physics", "fit_balanced")]
    sysid = {"rows": rows, "test": ["a"], "split": "as given", "best": "fit_balanced"}
    table, _ = sysid_screen(sysid, False)
    names = [line.split()[0] for line in lines_of(table, 80)[-3:]]
    assert names == ["fit_balanced", "naive", "published_physics"]
