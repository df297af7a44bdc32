"""The sentences above the tables are computed from the results at hand."""

import copy

from nanobench_tools.pages import words


def flat(lines):
    return " ".join(line if isinstance(line, str) else " ".join(line) for line in lines)


def test_the_published_table_says_what_was_wrong_and_by_how_much(results):
    assert words.is_published(results)
    text = flat(words.published(results))
    assert "ATE RMSE 400.0 mm as published, 40.0 mm corrected (10 times too large)" in text
    assert "In 2 of its 2 recordings the radio log ended" in text
    assert "1 recording fewer, because copies count once" in text
    changed = copy.deepcopy(results)
    changed["estimate"]["rows"][1]["metrics"]["ate_rmse_m"]["mean"] = 0.39
    assert "unchanged by the correction" in flat(words.published(changed))


def test_controllers_pair_rows_by_their_flights_and_not_by_their_names(results):
    text = flat(words.published(results))
    assert "PID: RMSE position 0.3000 m as published, 0.2700 m corrected (11 % too large)" in text
    assert "Heading error 6.000 deg as published, 1.000 deg corrected (6.0 times too large)" in text
    other = copy.deepcopy(results)
    other["control"]["rows"][1]["flights"] = ["another flight"]
    assert "0.2700 m corrected (" not in flat(words.published(other))


def test_task1_reads_the_published_thrust_error_from_the_published_numbers(results):
    assert "by 5.0 m/s² from the first step on, 0.51 of gravity" in flat(words.published(results))
    text = flat(words.task1(results))
    assert "Least position error at h = 50: physics with 0.1500 m, against 0.4500 m" in text
    other = copy.deepcopy(results)
    other["sysid"]["rows"][1]["published"]["velocity_mae_m_s"]["10"] = 0.2
    assert "gravity" not in flat(words.published(other))
    assert "gravity" not in text


def test_overview_counts(results):
    text = flat(words.overview(results))
    assert "2 recordings, 40.0 s in all; 2 leave the ground and fly for 32.0 s." in text
    assert "Among the recordings are 1 copy of others" in text
    left = {"left_out": [{"flight": "x", "reason": "slice of y"}, {"flight": "z", "reason": "slice of y"}]}
    assert "1 copy and 2 slices of others" in flat(words.overview({**results, "control": left}))
    assert "dead stream in 2, spike in 2" in text


def test_recordings_in_no_row_are_counted_by_reason(results):
    reasons = ["copy of a", "copy of b", "slice of a", "never in the air"]
    left = [{"flight": str(i), "reason": reason} for i, reason in enumerate(reasons)]
    body = {**results["estimate"], "left_out": left}
    assert words.task3({"estimate": body})[-1] == (
        "Excluded: 4 recordings, 2 (copy of another); 1 (slice of another); 1 (never in the air).")
    assert words.task2({"control": {**results["control"], "gate_note": "no gate yet"}})[-1] == "No gate yet."


def test_nothing_is_said_of_absent_results():
    for section in (words.task1, words.task2, words.task3, words.published, words.mismatch):
        assert section({}) == []
    assert not words.is_published({})
    assert len(words.overview({})) == 1


def test_task3_says_what_is_a_clock_and_which_streams_told(results):
    text = flat(words.task3(results))
    assert "largely a clock error and not an estimator error" in text
    assert ("ATE: 21.0 mm as recorded, 20.0 mm less a constant offset, 9.0 mm re-timed (57 % less, ratio 0.39 .. 0.47)."
            in text)
    assert "shown in 2 of 2 flights. This clock was set by gyro, attitude against the motion capture." in text
    assert "does not show what the vehicle could know in flight" in text
    changed = copy.deepcopy(results)
    changed["estimate"]["rows"][-1]["metrics"]["ate_rmse_m"]["mean"] = 0.0205
    assert "largely a clock" not in flat(words.task3(changed))
    unsure = copy.deepcopy(results)
    unsure["estimate"]["rows"][-1]["clock_ratio_ci95"]["ate_rmse_m"] = [0.2, 1.01]
    assert "largely a clock" not in flat(words.task3(unsure))
    assert "9.0 mm re-timed (no difference shown, ratio 0.20 .. 1.01)" in flat(words.task3(unsure))
    recorded = [r for r in results["estimate"]["rows"] if "clock" not in r]
    assert "re-timed" not in flat(words.task3({**results, "estimate": {"rows": recorded}}))


def test_task1_pairs_models_by_clock_and_never_averages_over_clocks(results):
    text = flat(words.task1(results))
    other = copy.deepcopy(results)
    rows = other["sysid"]["rows"]
    moved = {**copy.deepcopy(rows[1]), "clock": "retimed"}
    moved["metrics"]["position_mae_m"]["50"] = 0.135
    rows.append(moved)
    said = flat(words.task1(other))
    assert "physics: position error at h = 50 is 0.1500 m as recorded and 0.1350 m re-timed." in said
    by_h = {"position_mae_m": {"50": 0.9}}  # how much less is no result without interval
    for ends, text in (([0.85, 0.96], "10 % less (ratio 0.85 .. 0.96)"),
                       ([0.8, 1.1], "no difference shown (ratio 0.80 .. 1.10)")):
        moved |= {"clock_ratio": by_h, "clock_ratio_ci95": {"position_mae_m": {"50": ends}}}
        assert f"0.1350 m re-timed: {text}" in flat(words.task1(other))
    assert "Least position error at h = 50, as recorded: physics with 0.1500 m" in said
    assert "re-timed" not in text


def test_task1_says_which_models_cannot_be_told_apart(results):
    other = copy.deepcopy(results)
    rows = other["sysid"]["rows"]
    more = [{**copy.deepcopy(rows[0]), "model": name, "ratio_to": "physics",
             "ratio": {"position_mae_m": {"50": 1.0}}, "ratio_ci95": {"position_mae_m": {"50": ends}}}
            for name, ends in (("near", [0.9, 1.1]), ("less", [0.7, 0.8]), ("more", [1.1, 1.3]))]
    other["sysid"]["rows"] = [*rows, *more]
    assert "position error at h = 50: near cannot be distinguished from physics; only less has less error." in flat(
        words.task1(other))
    other["sysid"]["rows"] = [*rows, more[2]]
    assert "at h = 50: every other model differs from physics." in flat(words.task1(other))
    assert "differs" not in flat(words.task1(results))


def test_dead_reckoning_is_shown_on_every_clock(results):
    rows = [{"protocol": "blackout", "method": "drag", "group": "all", "clock": clock, "n": 2,
             "clock_evidence": ["gyro", "position"], "metrics": {"end_error_5s_m": {"mean": value}}}
            for clock, value in (("as-recorded", 0.3), ("offset", 0.29), ("retimed", 0.25), ("joint", 0.21))]
    said = flat(words.task3({**results, "estimate": {"rows": rows}}))
    assert "drag on every clock, 5 s later: 0.300 m as recorded, 0.290 m offset, 0.250 m retimed, 0.210 m joint" in said
    assert "set the joint clock: gyro, position" in said
