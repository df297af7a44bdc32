"""Where the names of a table stand: behind Excel's line, comments, prose, a mark; above a row of units."""

from __future__ import annotations

import pytest

from nanobench_tools.errors import InputError
from nanobench_tools.sources.cells import read_grid
from nanobench_tools.sources.header import header_of
from nanobench_tools.sources.units_as_written import unit_as_written

ROWS = b"0.0,1.0,2.0\n0.1,1.5,2.5\n"


@pytest.mark.parametrize(("above", "names"), [
    (b"t,x,y\n", ["t", "x", "y"]),
    (b"\xef\xbb\xbft,x,y\r\n", ["t", "x", "y"]),
    (b"sep=,\nt,x,y\n", ["t", "x", "y"]),
    (b"# made by a script, on a Tuesday\n# t,x,y\n", ["t", "x", "y"]),
    (b"# made by a script\n#\nt,x,y\n", ["t", "x", "y"]),
    (b"%t,x,y\n", ["t", "x", "y"]),
    (b"Subject: one\nt,x,y\n", ["t", "x", "y"]),
    (b'"t","x","y"\n', ["t", "x", "y"])])
def test_the_line_of_names(above, names):
    assert header_of(above + ROWS)[0] == names
    grid = read_grid(above + ROWS, "table.csv")
    assert grid.columns["y"].tolist() == [2.0, 2.5]
    assert grid.lines[0] == above.count(b"\n") + 1


def test_a_row_of_units():
    grid = read_grid(b"t,x,y\n[s],[mm],m s^-1\n" + ROWS, "table.csv")
    assert grid.units == {"t": "s", "x": "mm", "y": "m/s"}
    assert grid.lines.tolist() == [3, 4]


def test_an_unknown_unit_does_not_hide_the_others():
    grid = read_grid(b"t,x,y,b\ns,mm,ft,m/s\n" + b"0.0,1.0,2.0,3.0\n0.1,1.5,2.5,3.5\n", "table.csv")
    assert grid.units == {"t": "s", "x": "mm", "y": "ft", "b": "m/s"}
    assert read_grid(b"t,x,y\nstart,m,up\n" + ROWS, "table.csv").units == {}


def test_a_row_of_text_is_no_row_of_units():
    grid = read_grid(b"t,x,y\n0.0,a,b\n" + ROWS, "table.csv")
    assert grid.units == {}
    assert len(grid.lines) == 3


def test_names_apart_by_blanks_below_a_mark():
    grid = read_grid(b"# timestamp ang_vel_x ang_vel_y\n1.5 2.5 3.5\n2.5 3.5 4.5\n", "imu.txt")
    assert list(grid.columns) == ["timestamp", "ang_vel_x", "ang_vel_y"]


def test_a_header_of_another_system():
    assert header_of("t;ESC (µs)\n0;1000\n1;1100\n".encode("latin-1"))[0] == ["t", "ESC (µs)"]


def test_excel_with_decimal_commas():
    grid = read_grid(b"sep=;\nt;x\n0,00;0,5000\n0,02;0,4994\n", "table.csv")
    assert grid.columns["x"].tolist() == [0.5, 0.4994]


def test_a_table_without_names_is_said_to_have_none():
    with pytest.raises(InputError, match="no header: its first line holds numbers"):
        read_grid(b"1403715524907143168,0.5,0.0,1.0\n1403715524957143168,0.4,0.1,1.0\n", "table.csv")


@pytest.mark.parametrize(("text", "unit"), [
    ("m s^-1", "m/s"), ("rad s^-1", "rad/s"), ("m s^-2", "m/s^2"), ("m/s²", "m/s^2"), ("°/s", "deg/s"), ("µs", "us"),
    ("μs", "us"), ("kgf", "kgf"), ("gf", "gram_force"), ("RPM", "rpm"), ("Nm", None), ("hPa", None), ("G", "g"),
    ("m·s⁻¹", "m/s"), ("%", "%"), ("", None), ("mm", "mm"), ("Mm", "mm"), ("A", "A"), ("V", "V"), ("mV", "mV")])
def test_units_as_written(text, unit):
    assert unit_as_written(text) == unit


@pytest.mark.parametrize("above", [
    b"time,pos,,vel,\n,x,y,x,y\n", b"time,pos,,vel,\n,x,y,x,y\ns,m,m,m/s,m/s\n",
    b",pos,pos,vel,vel\n,x,y,x,y\ntime,,,,\n"])
def test_names_in_groups_are_joined(above):
    grid = read_grid(above + b"0.0,1.0,2.0,3.0,4.0\n0.1,1.5,2.5,3.5,4.5\n", "table.csv")
    assert list(grid.columns) == ["time", "pos.x", "pos.y", "vel.x", "vel.y"]
    assert grid.columns["vel.x"].tolist() == [3.0, 3.5]
    assert grid.lines.tolist() == [above.count(b"\n") + 1, above.count(b"\n") + 2]


def test_damaged_rows_below_names_are_no_names():
    grid = read_grid(b"t,x,y\na,b,c\nd,e,f\n" + ROWS, "table.csv")
    assert grid.columns["y"].tolist()[-2:] == [2.0, 2.5]
