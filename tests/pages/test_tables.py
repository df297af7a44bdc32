"""Tables: the same rows for the page, the spreadsheet and LaTeX."""

import csv
import doctest
import io
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nanobench_tools.pages.result_tables import tables_of
from nanobench_tools.tables import quantities
from nanobench_tools.tables.quantities import DASH, MINUS, format_duration, format_number
from nanobench_tools.tables.result_table import (
    Column,
    Score,
    Table,
    latex_escape,
    score_text,
    to_csv,
    to_latex,
    write_tables,
)

METRES = Column("error_m", "Error", "score", "mm", 1e3, 1)


def test_the_examples_in_the_docstrings_hold():
    assert doctest.testmod(quantities).failed == 0


@pytest.mark.parametrize(("value", "decimals", "text"), [
    (None, 2, DASH), (float("nan"), 2, DASH), (float("inf"), 2, DASH), (0.0, 2, "0.00"), (-1.25, 1, f"{MINUS}1.2"),
    (0.00034, 3, "0.00034"), (12.3456, 2, "12.35"), (2.5e9, 1, "2.5e+09"), (3e-9, 1, "3.0e-09")])
def test_a_number_keeps_two_digits_and_what_is_none_is_a_dash(value, decimals, text):
    assert format_number(value, decimals) == text


def test_durations_read_as_a_person_says_them():
    assert [format_duration(s) for s in (42.34, 200.0, 3900.0, None)] == ["42.3 s", "3 min 20 s", "1 h 05 min", DASH]


def test_a_published_row_shows_only_the_digits_that_were_printed():
    assert score_text(Score(0.00034, 0.000021, exact=True), METRES) == ("0.3 ± 0.0", "")  # as it was printed
    assert score_text(Score(0.0211046, 0.0033372, low=0.0190, high=0.0232), METRES) == ("21.1 ± 3.3", "[19.0, 23.2]")


def test_deviation_and_interval_have_the_digits_of_the_mean_and_one_flight_has_no_deviation():
    assert score_text(Score.of({"mean": 0.0000212, "std": 0.0000001, "n": 4}), METRES) == ("0.021 ± 0.0001", "")
    assert score_text(Score.of({"mean": 0.02, "std": 0.0, "n": 4}), METRES) == ("20.0", "")
    assert score_text(Score.of({"mean": 0.02, "std": 0.0, "n": 1}), METRES) == ("20.0", "")


def test_rows_that_are_compared_stand_in_a_table_of_their_own(results):
    table = next(t for t in tables_of(results, False) if t.name == "table_task3_ratios")
    assert [c.key for c in table.columns][:5] == ["protocol", "method", "clock", "over", "ate_rmse_m"]
    assert [row[2:4] for row in table.rows] == [("offset", "as-recorded"), ("retimed", "as-recorded")]
    assert score_text(table.rows[1][4], table.columns[4]) == ("0.429", "[0.386, 0.471]")
    assert "holds 1 shows no difference" in table.note


def test_tables_show_sessions_and_say_how_far_to_trust_intervals(results):
    rows = [{**row, "sessions": 4, "ci_why": "4 sessions: too narrow to trust", "design_effect": {"ate_rmse_m": 4.0}}
            for row in results["estimate"]["rows"]]
    found = tables_of({"estimate": {**results["estimate"], "rows": rows}}, False)
    for table in (t for t in found if t.name in ("table_task3", "table_task3_clean", "table_task3_clocks")):
        assert {row[[c.key for c in table.columns].index("sessions")] for row in table.rows} <= {4, None}
        assert "bootstrap of 4 sessions, then of flights within them; too narrow to trust (fewer than 5)" in table.note
        assert "2.0 times as wide" in table.note
        assert "too narrow to trust" in to_csv(table)
        assert "too narrow to trust" in to_latex(table)


def test_long_texts_are_numbers_for_readers_and_whole_in_the_csv(results):
    table = next(t for t in tables_of(results, False) if t.name == "table_task3_clean")
    short = table.for_readers()
    at = [c.key for c in short.columns].index("given")
    assert short.rows[0][at] == "1"
    assert short.note.endswith("Given 1: all.")
    assert ",all," in to_csv(table)


@settings(deadline=None)
@given(st.text(st.characters(exclude_categories=["Cs"]), max_size=40))
def test_no_text_reaches_latex_as_a_command(text):
    escaped = latex_escape(text)
    left = re.sub(r"\\text(backslash|asciitilde|asciicircum|less|greater|bar|quotedbl)\{\}|\\textsuperscript\{2\}|"
                  r"\\[{}$&#_%]|\$\\pm\$|\$-\$", "", escaped)
    assert not re.search(r"[\\{}$&#^_~%<>|\"]", left)
    assert "\n" not in escaped


@settings(deadline=None)
@given(st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\r\n\0"), max_size=30))
def test_a_spreadsheet_gets_the_text_back_and_never_a_formula(name):
    table = Table("t", "T", (Column("flight", "Flight"), METRES), ((name, Score(0.5)),))
    heading, row = list(csv.reader(io.StringIO(to_csv(table), newline="")))
    assert heading == ["flight", "error_m [mm]"]
    assert row[0] in (name, "'" + name)
    assert row[0][:1] not in ("=", "+", "-", "@", "\t")
    assert float(row[1]) == 500.0


def test_csv_holds_full_precision_every_spread_and_empty_cells():
    rows = (("a", 3, Score(0.1234567891, 0.01, 0.12, 0.2, 0.1, 0.15)), ("b", None, Score(None)))
    columns = (Column("name", "Name"), Column("n", "n", "count"), METRES)
    lines = list(csv.DictReader(io.StringIO(to_csv(Table("t", "T", columns, rows)), newline="")))
    assert float(lines[0]["error_m [mm]"]) == pytest.approx(123.4567891, abs=1e-7)
    assert lines[0]["error_m ci95_low [mm]"] == "100.0"
    assert lines[1] == {**dict.fromkeys(lines[1], ""), "name": "b"}


def test_latex_table_is_whole_and_as_wide_as_its_rows():
    columns = (Column("flight", "Flight_name"), METRES)
    text = to_latex(Table("t", "50 % of\nit", columns, (("a&b", Score(None)),), "noted"))
    lines = text.splitlines()
    assert lines[0] == "% 50 % of it"
    assert lines[1] == r"\begin{tabular}{lr}"
    assert lines[-2:] == [r"\end{tabular}", "% noted"]
    assert r"a\&b & -- \\" in lines
    assert r"Flight\_name & Error [mm] \\" in lines


def test_every_row_says_what_it_was_made_from(results):
    for synthetic, word in ((False, "real"), (True, "SYNTHETIC")):
        for table in tables_of(results, synthetic):
            data = [c.key for c in table.columns].index("data")
            assert {row[data] for row in table.rows} <= {word, "published"}
            assert word in {row[data] for row in table.rows}


def test_results_that_are_absent_make_no_table():
    assert tables_of({}, False) == []
    assert tables_of({"estimate": {"rows": []}, "audit": {"flights": []}}, False) == []


def test_published_values_stand_beside_ours(results):
    table = next(t for t in tables_of(results, False) if t.name == "table_task1")
    at = [c.key for c in table.columns].index("velocity_mae_m_s h=1")
    found = {row[0]: row[at].mean for row in table.rows}
    assert found["physics"] == 0.001
    assert found["physics (published)"] == 0.05


def test_a_metric_nobody_knows_is_in_the_csv_but_not_on_the_page(results):
    table = next(t for t in tables_of(results, False) if t.name == "table_task3_clean")
    assert "strange_m" in to_csv(table)
    assert "strange" not in to_latex(table)


def test_files_are_written_and_opened_as_utf8_by_a_spreadsheet(tmp_path):
    table = Table("table_x", "T", (Column("flight", "Flight"),), (("Übung ±",),))
    paths = write_tables(tmp_path, [table], "SYNTHETIC")
    assert [p.name for p in paths] == ["table_x.csv", "table_x.tex"]
    assert paths[0].read_bytes().startswith(b"\xef\xbb\xbf")
    assert "Übung ±" in paths[0].read_text("utf-8-sig")
    assert paths[1].read_text().startswith("% T (SYNTHETIC)")


def test_task1_shows_one_clock_and_beside_it_a_table_of_both(results):
    assert "table_task1_clocks" not in {t.name for t in tables_of(results, False)}
    rows = results["sysid"]["rows"]
    both = [{**row, "clock": clock} for clock in ("as-recorded", "retimed") for row in rows]
    mass = {"physics": {"mass": {"value": 0.041, "ci95": None, "unit": "kg"}}}
    sysid = {**results["sysid"], "rows": both, "clock": "as-recorded", "by_clock": {"retimed": {"parameters": mass}}}
    tables = {t.name: t for t in tables_of({"sysid": sysid}, False)}

    def cells(name, *keys):
        table = tables[name].for_readers()
        at = [[c.key for c in table.columns].index(key) for key in keys]
        return [tuple(row[i] for i in at) for row in table.rows]

    assert cells("table_task1_clocks", "model", "clock") == [
        (model, clock) for model in ("naive", "physics") for clock in ("as-recorded", "retimed")]
    assert cells("table_task1", "model", "clock") == [
        ("naive", "as-recorded"), ("physics (published)", ""), ("physics", "as-recorded")]
    assert len(tables["table_task1"].rows) == 5  # the others in the CSV file, the published one once
    assert [value.mean for value, in cells("table_task1_parameters", "value")] == [0.04]
    assert [row[-1].mean for row in tables["table_task1_parameters"].rows] == [0.04, 0.041]


def test_a_parameter_that_no_flight_tells_is_marked():
    few = "3 sessions: too narrow to trust"
    fitted = {"drag": {"value": 0.01, "ci95": [0.008, 0.012], "unit": "N s/m", "ci_why": few},
              "k_m": {"value": 1e-5, "ci95": [0.0, 7e-5], "unit": "m", "ci_why": f"{few}; ends at a bound"},
              "J": {"value": 0.5, "ci95": None, "unit": "kg m^2", "ci_why": "held"}}
    table = next(t for t in tables_of({"sysid": {"rows": [], "parameters": {"fit": fitted}}}, False)
                 if t.name == "table_task1_parameters")
    at = [c.key for c in table.columns].index("ci_why")
    assert [row[at] for row in table.rows] == ["", "ends at a bound", "held"]
    assert few in table.note


def test_clocks_are_columns_and_never_mixed(results):
    tables = {t.name: t for t in tables_of(results, False)}
    table = tables["table_task3_clocks"]
    keys = [c.key for c in table.columns]
    step, clock, ate, n = (keys.index(k) for k in ("step", "clock", "ate_rmse_m", "n_moving"))
    assert [(r[step], r[clock], r[ate].mean, r[n]) for r in table.rows] == [
        ("cleaned", "as-recorded", 0.021, None), ("constant offset removed", "offset", 0.02, None),
        ("re-timed", "retimed", 0.009, 2)]
    clean = tables["table_task3_clean"]
    for shown, clocks in ((clean.for_readers(), {"as-recorded"}), (clean, {"as-recorded", "offset", "retimed"})):
        at = [c.key for c in shown.columns].index("clock")
        assert {row[at] for row in shown.rows} == clocks
    assert "retimed" in to_csv(clean)
    assert "Clock" in to_latex(table)
    assert "retimed" in to_latex(table)


def test_results_from_before_there_were_clocks_have_no_such_table(results):
    rows = [r for r in results["estimate"]["rows"] if "clock" not in r]
    tables = tables_of({"estimate": {"rows": rows}}, False)
    assert "table_task3_clocks" not in {t.name for t in tables}
    assert not any(c.key == "clock" for t in tables for c in t.columns)
    alone = [r for r in results["estimate"]["rows"] if r.get("clock") == "retimed"]
    table, _ = tables_of({"estimate": {"rows": alone}}, False)
    assert len(table.for_readers().rows) == 1
