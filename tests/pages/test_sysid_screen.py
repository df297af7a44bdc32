"""The screen of Task 1."""

from nanobench_tools.pages.sysid_tables import sysid_screen, vehicle_tables
from nanobench_tools.tables.terminal import lines_of

METRICS = ("position_mae_m", "velocity_mae_m_s", "attitude_mae_rad", "rate_mae_rad_s")


def test_the_best_model_is_the_first_row():
    rows = [{"group": "all", "model": name, "information": "state", "truth": "onboard",
             "ci95": {"position_mae_m": {}}, "metrics": {metric: {"50": 0.1} for metric in METRICS}}
            for name in ("naive", "published_physics", "fit_balanced")]
    sysid = {"rows": rows, "test": ["a"], "split": "as given", "best": "fit_balanced"}
    table = sysid_screen(sysid, False)
    names = [line.split("  ")[0] for line in lines_of(table, 100)[-3:]]
    assert names == ["all terms, from the inputs before", "naive", "published_physics"]


def test_the_vehicle_is_shown_with_the_share_of_its_priors():
    def entry(value, unit, share):
        return {"value": value, "ci95": None, "unit": unit, "ci_why": "", "prior_share": share}

    fit = {"thrust_spread": 0.02, "parameters": {
        "inertia.inertia_kg_m2[0]": entry(1.67e-5, "kg m^2", 0.76),
        "inertia.inertia_kg_m2[1]": entry(1.66e-5, "kg m^2", 1.0),
        "yaw_torque.k_m": entry(0.0068, "m", 1.0)}}
    sentence, table = vehicle_tables({"fits": {"fit_full": {"thrust_spread": None}, "fit_vehicle": fit}})
    assert sentence == "Exported vehicle, prior alone: yaw torque; mostly prior: inertia."
    assert table.rows[0] == ("inertia.inertia_kg_m2", "1.67e-05, 1.66e-05", "kg m^2", "76, 100")
    assert table.rows[1] == ("yaw_torque.k_m", "0.0068", "m", "100")
    assert vehicle_tables({"fits": {}}) == []
