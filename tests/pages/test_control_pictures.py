"""Pictures of Task 2: what is drawn of made-up results."""

import numpy as np
import pytest

from nanobench_tools.pages import control_pictures
from nanobench_tools.protocols.simulated import Runs, call_counts, solve_times
from nanobench_tools.results.result import to_json

TIMES = (0.05 * np.arange(40)).tolist()
GOAL = np.column_stack([np.cos(TIMES), np.sin(TIMES), np.ones(40)])


def flight(name, reference, speed, off):
    return {"controller": name, "reference": reference, "speed_m_s": speed, "time_s": TIMES,
            "reference_m": GOAL.tolist(), "flown_m": (GOAL + np.array([0.0, 0.0, off])).tolist(), "error_m": [off] * 40}


def row(name, reference, speed, rmse, lost=0.0):
    return {"plant": "simulated", "controller": name, "reference": reference, "speed_m_s": speed, "information": "lead",
            "n": 4, "metrics": {"rmse_m": rmse, "contour_rmse_m": 0.5 * rmse, "worst_decile_m": 2.0 * rmse,
                                "lost_percent": lost}}


ROWS = [row(name, reference, speed, size * speed) for name, size in (("good", 0.02), ("bad", 0.2))
        for reference in ("circle", "star") for speed in (0.5, 1.0)]
BODY = {"rows": [*ROWS, row("good", "oval", 0.5, 9.0)],
        "error_bar": {"rmse_share": 0.03, "rmse_share_p90": 0.1, "n": 5},
        "flights": [flight(name, "circle", speed, off) for name, off in (("good", 0.01), ("bad", 0.3))
                    for speed in (0.5, 1.0)],
        "gate_flights": [{"flight": "one <b>", "controller": "pid", "time_s": TIMES, "reference_m": GOAL.tolist(),
                          "real_m": (GOAL + 0.1).tolist(), "simulated_m": (GOAL + 0.12).tolist()}]}


def marks(figure, panel):
    return {mark.name: mark for mark in figure.panels[panel].marks}


def test_the_race_is_at_the_highest_speed_and_every_second_sample():
    ((name,), one), = control_pictures.pictures(BODY)["race"].figures.items()
    assert name == "circle, 1 m/s"
    assert list(marks(one, 0)) == ["reference", "good", "bad"]
    assert marks(one, 1)["bad"].y == pytest.approx([0.3] * 20)
    assert len(marks(one, 0)["reference"].x) == 20
    assert one.cursor == pytest.approx((0.0, 1.9))


def test_error_against_speed_compares_the_same_families_and_the_ranking_has_the_gates_bar():
    found = control_pictures.pictures(BODY)
    assert "(circle, star)" in found["speeds"].note  # the oval was flown at one speed
    line = found["speeds"].panels[0].marks[0]
    assert (line.name, line.x) == ("good", [0.5, 1.0])
    assert line.y == pytest.approx([0.01, 0.02])
    (panel,) = found["ranking"].panels
    assert panel.y.rows == ["good", "bad"]
    first = panel.marks[0]
    assert first.high[0] - first.x[0] == pytest.approx(0.1 * first.x[0])


@pytest.mark.parametrize(("flights", "results", "word"), [
    ({}, {}, "recorded"), ({"synthetic": False}, {"synthetic": True}, "recorded"),  # others beside it are simulated
    ({"synthetic": True}, {"synthetic": True}, "SYNTHETIC recording"),
    ({}, {"synthetic": True}, "SYNTHETIC recording")])
def test_the_recording_says_whether_a_flight_is_real(flights, results, word):
    body = BODY | results | {"gate_flights": [one | flights for one in BODY["gate_flights"]]}
    (one,) = control_pictures.pictures(body)["gateflights"].figures.values()
    assert list(marks(one, 0)) == ["reference", word, "simulated"]


def test_the_gap_of_a_real_flight_is_its_distance():
    (one,) = control_pictures.pictures(BODY)["gateflights"].figures.values()
    assert marks(one, 1)["recorded"].y[0] == pytest.approx(0.1 * np.sqrt(3.0), abs=5e-4)  # drawn in millimetres


def test_solver_times_are_shares_of_all_commands_and_lose_none():
    calls = np.array([2e-5, 2e-5, 3e-4, 9.0])
    quick = Runs("quick", "lead", [], call_counts=call_counts(calls))
    times = to_json(solve_times([quick, quick, Runs("silent", "lead", [])]))
    assert sum(times[0]["counts"]) == 8
    assert times[0]["counts"][-1] == 2  # nine seconds are beyond
    (line,) = control_pictures.pictures({"solve_times": times})["solver"].panels[0].marks
    assert sum(line.y) == pytest.approx(100.0)
    assert line.x[int(np.argmax(line.y))] == pytest.approx(0.02, rel=0.15)


def test_without_results_there_is_no_picture():
    assert set(control_pictures.pictures(None).values()) == {None}
