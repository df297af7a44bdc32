"""Tables and closing lines at the width of the terminal, and in a pipe."""

import io
import sys
from dataclasses import replace

import pytest

from nanobench_tools.cli.closing import _with_one_row, close
from nanobench_tools.metrics.statistics import summary
from nanobench_tools.steps.options import Options
from nanobench_tools.steps.show import interval_text, score_text
from nanobench_tools.tables.result_table import Column, Score, Table
from nanobench_tools.tables.terminal import lines_of

SENTENCES = ("all 17.6 s of the flight are usable; timestamps are corrected",
             "the gyro was saturated for 0.25 s near 12 s",
             "leave the recording out of identification")


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def shown(monkeypatch):
    """(what to do, columns or None for a pipe) -> the text."""
    def show(act, columns, lines=24):
        text = io.StringIO() if columns is None else Terminal()
        monkeypatch.setenv("COLUMNS", str(columns or 80))
        monkeypatch.setenv("LINES", str(lines))
        monkeypatch.setattr(sys, "stdout", text)
        act()
        return text.getvalue()

    return show


def table(n=3):
    return Table.plain("Audit", ("recording", "verdict", "what to do"),
                       [(f"B9_trefoil_{i}", SENTENCES[i % 3], SENTENCES[-1]) for i in range(n)])


def scores(columns=6, rows=4):
    heads = tuple(Column(f"m{k}", f"metric {k}", "score", "mm", 1e3, 1) for k in range(columns))
    lines = tuple((f"method_{i}", *(Score(0.0123 * (i + 1) + 0.001 * k, 0.0012, None, None, 0.01, 0.02)
                                    for k in range(columns))) for i in range(rows))
    return Table("t", "Scores", (Column("method", "method"), *heads), lines)


@pytest.mark.parametrize("columns", [80, 200])
def test_a_table_stays_within_the_terminal_and_breaks_no_word(shown, columns):
    lines = shown(lambda: Options().show(table()), columns).splitlines()
    assert max(map(len, lines)) <= columns
    words = set(" ".join(lines).split())
    assert {word for sentence in SENTENCES for word in sentence.split()} <= words
    assert {f"B9_trefoil_{i}" for i in range(3)} <= words


@pytest.mark.parametrize("width", [30, 40, 60, 80, 120, 200])
def test_no_number_is_cut_and_columns_are_left_out_or_stacked(width):
    whole = set(" ".join(lines_of(scores(), 1000)).split())
    for stack in (False, True):
        lines = lines_of(scores(), width, stack)
        assert max(map(len, lines)) <= width
        numbers = {word for word in " ".join(lines).split() if word.replace(".", "").isdigit() and "." in word}
        assert numbers <= whole
    means = {f"{1e3 * row[k].mean:.1f}" for row in scores().rows for k in range(1, 7)}
    assert means <= set(" ".join(lines_of(scores(), width, stack=True)).split())
    narrow = " ".join(lines_of(scores(), width))
    assert "Left out at this width" in narrow or means <= set(narrow.split())


def test_in_a_pipe_a_row_is_a_line_without_padding(shown):
    text = shown(lambda: Options().show(table()), None)
    assert "\x1b" not in text
    assert len([line for line in text.splitlines() if line.startswith("B9")]) == 3
    assert all(line == line.rstrip() for line in text.splitlines())
    assert max(map(len, text.splitlines())) <= 80
    every = shown(lambda: Options(verbose=True).show(table()), None).splitlines()
    assert sum(line.endswith(SENTENCES[-1]) for line in every) == 3


def test_in_a_pipe_sentences_stay_whole_and_count_as_lines_of_80_columns(shown):
    note = " ".join(["a sentence that is longer than the screen is wide"] * 8)
    lines = shown(lambda: close(Options(), "3 fine", "next", "nanobench", "audit", screen=[table(102), note]),
                  None).splitlines()
    assert note in lines
    assert sum(-(-len(line) // 80) for line in lines) < 24


@pytest.mark.parametrize("columns", [40, 80, 200, None])
def test_a_command_to_paste_is_one_line_whatever_the_width(shown, columns):
    paths = [f"/a/long/path/flight_{i}.csv" for i in range(9)]
    text = shown(lambda: close(Options(), "", "where was it", "nanobench", "estimate", *paths), columns)
    assert text.splitlines() == ["Next, where was it: nanobench estimate " + " ".join(paths)]


@pytest.mark.parametrize("rows", [1, 5, 102])
def test_a_verb_ends_within_one_screen_and_says_what_is_left_out(shown, rows):
    lines = shown(lambda: close(Options(), "3 fine", "next", "nanobench", "estimate", screen=[table(rows), "a note"]),
                  80).splitlines()
    assert len(lines) <= 23
    assert lines[-2:] == ["3 fine", "Next, next: nanobench estimate"]
    counted = [int(line.split()[1]) for line in lines if line.startswith("... ")]
    there = sum(line.startswith("B9_trefoil") for line in lines)
    assert there + sum(counted) == rows
    every = shown(lambda: close(Options(verbose=True), "3 fine", screen=[table(rows)]), 80)
    assert every.count("B9_trefoil") == rows


def test_the_least_lines_of_a_table_hold_its_first_row_where_other_rows_widen_its_columns():
    wide = scores(5, 4)
    rows = (("a", *wide.rows[0][1:]), *wide.rows[1:3], ("a_method_with_a_very_long_name_indeed", *wide.rows[3][1:]))
    cut = replace(wide, rows=rows, note="a note")
    least = _with_one_row(cut, 60)
    assert any(line.startswith("a  ") for line in lines_of(cut, 60, most=least))
    assert not any(line.startswith("a  ") for line in lines_of(cut, 60, most=least - 1))


def test_one_flight_has_no_spread():
    one = summary([0.0123])
    assert score_text(one, 1.0, 4) == "0.0123"
    assert interval_text(one, 1.0, 4) == "-"
    assert "nan" not in score_text(summary([]), 1.0, 4)


def test_a_column_of_text_that_is_empty_everywhere_is_not_shown():
    rows = [("a", "1.0", ""), ("b", "2.0", "")]
    assert "what to do" not in "\n".join(lines_of(Table.plain("T", ("recording", "s", "what to do"), rows), 80))
    rows.append(("c", "3.0", "mend it"))
    assert "mend it" in "\n".join(lines_of(Table.plain("T", ("recording", "s", "what to do"), rows), 80))


def test_a_long_topic_in_a_sentence_is_broken_rather_than_the_verdict_left_out():
    topic = "/vrpn_client_node/uav1/pose.pose.orientation.x"
    table = Table.plain("", ("recording", "", "verdict"),
                        [("bag_clocks_do_not_overlap.flight", "unusable", f"not usable: {topic} is in another unit")])
    lines = lines_of(table, 80)
    assert max(map(len, lines)) <= 80
    assert topic in "".join(line[44:].strip() for line in lines)
