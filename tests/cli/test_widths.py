"""Tables and closing lines at the width of the terminal, and in a pipe."""

import io
import re
import sys

import pytest
from rich import box
from rich.table import Table

from nanobench_tools.metrics.statistics import summary
from nanobench_tools.steps.options import Options
from nanobench_tools.steps.show import interval_text, score_text

SENTENCES = ("all 17.6 s of the flight are usable; stamps are corrected", "the gyro was saturated for 0.25 s near 12 s",
             "leave the recording out of identification")


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def shown(monkeypatch):
    """(table, columns or None for a pipe) -> the text."""
    def show(table, columns, **kwargs):
        text = io.StringIO() if columns is None else Terminal()
        monkeypatch.setenv("COLUMNS", str(columns or 80))
        monkeypatch.setattr(sys, "stdout", text)
        Options().show(table, **kwargs)
        return re.sub(r"\x1b\[[0-9;]*m", "", text.getvalue()) if columns else text.getvalue()

    return show


def table():
    made = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for name in ("recording", "verdict", "what to do"):
        made.add_column(name, overflow="fold")
    for i, sentence in enumerate(SENTENCES):
        made.add_row(f"B9_trefoil_{i}", sentence, SENTENCES[-1])
    return made


@pytest.mark.parametrize("columns", [80, 200])
def test_a_table_stays_within_the_terminal_and_breaks_no_word(shown, columns):
    lines = shown(table(), columns).splitlines()
    assert max(map(len, lines)) <= columns
    words = set(" ".join(lines).split())
    known = {word for sentence in SENTENCES for word in sentence.split()}
    assert known <= words
    assert {f"B9_trefoil_{i}" for i in range(3)} <= words


def test_in_a_pipe_a_row_is_a_line_without_colour_or_padding(shown):
    made = table()
    made.add_row("[red]B10[/]", "short", "nothing")
    text = shown(made, None)
    assert "\x1b" not in text
    rows = [line.strip() for line in text.splitlines() if line.strip().startswith("B")]
    assert len(rows) == 4
    assert all(line == line.rstrip() for line in text.splitlines())
    assert rows[0].split("  ")[0] == "B9_trefoil_0"


@pytest.mark.parametrize("columns", [40, 80, 200, None])
def test_a_command_to_paste_is_one_line_whatever_the_width(shown, columns):
    command = "Next, where was it: nanobench estimate " + " ".join(f"/a/long/path/flight_{i}.csv" for i in range(9))
    assert shown(command, columns, fold=False).splitlines() == [command]


def test_one_flight_has_no_spread():
    one = summary([0.0123])
    assert score_text(one, 1.0, 4) == "0.0123"
    assert interval_text(one, 1.0, 4) == "-"
    assert "nan" not in score_text(summary([]), 1.0, 4)
