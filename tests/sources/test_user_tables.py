"""The user's own tables through a column map."""

from __future__ import annotations

import math
import sys

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from nanobench_tools import InputError
from nanobench_tools.signals.column_draft import draft_columns
from nanobench_tools.sources import load_recordings
from nanobench_tools.sources.column_map import read_column_map

MAP = """schema = "nanobench-columns/1"
time = {column = "t", unit = "s"}
[streams.mocap]
px = {column = "p", index = 0, unit = "m"}
py = {column = "p", index = 1, unit = "mm"}
qw = {column = "q", index = 3}
[streams.imu]
gyro_x = {column = "w", index = 0, unit = "deg/s", sign = -1}
[streams.command]
thrust = {column = "T_sp", unit = "pwm16"}
[vehicle]
name = "custom"
"""
POSITIONS = [[1.0, 2000.0, 3.0], [1.5, 2500.0, 3.0], [2.0, 1500.0, 3.0]]
QUATERNIONS = [[0.0, 0.0, 0.0, 1.0]] * 3
RATES = [[90.0, 0.0, 0.0], [180.0, 0.0, 0.0], [-90.0, 0.0, 0.0]]


@pytest.fixture
def column_map(tmp_path):
    path = tmp_path / "columns.toml"
    path.write_text(MAP)
    return path


def check(flight):
    assert flight.provenance.source == "table"
    assert flight.epoch_s == 100.0
    np.testing.assert_allclose(flight["mocap"]["px", "py", "qw"], [[1, 2, 1], [1.5, 2.5, 1], [2, 1.5, 1]])
    np.testing.assert_allclose(flight["imu"]["gyro_x"], [-math.pi / 2, -math.pi, math.pi / 2])
    np.testing.assert_allclose(flight["command"]["thrust"], [0.0, 0.5, 1.0], atol=1e-5)
    assert flight.metadata["vehicle"] == {"name": "custom"}
    np.testing.assert_allclose(flight["mocap"].time_s, [0.0, 0.1, 0.2], atol=1e-12)


def test_csv_with_list_cells(tmp_path, column_map):
    lines = [
        "t,p,q,w,T_sp",
        *(
            f'{100 + 0.1 * i},"{p}","{q}","{w}",{c}'
            for i, (p, q, w, c) in enumerate(zip(POSITIONS, QUATERNIONS, RATES, (0, 32767.5, 65535), strict=True))
        ),
    ]
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n")
    loaded = load_recordings([tmp_path], columns=column_map, cache=False)
    assert loaded.failed == []
    check(loaded.flights[0])
    assert loaded.flights[0].provenance.findings == ()


@pytest.mark.parametrize("kind", [pa.list_(pa.float64()), pa.list_(pa.float32(), 3), pa.string()])
def test_parquet(tmp_path, column_map, kind):
    size = {3: 4}.get(getattr(kind, "list_size", 0), 0)
    cells = (lambda rows: [str(r) for r in rows]) if pa.types.is_string(kind) else (lambda rows: rows)
    table = pa.table(
        {
            "t": [100.0, 100.1, 100.2],
            "p": pa.array(cells(POSITIONS), kind),
            "w": pa.array(cells(RATES), kind),
            "q": pa.array(cells(QUATERNIONS), pa.list_(pa.float32(), size) if size else kind),
            "T_sp": pa.array([0.0, 32767.5, 65535.0]),
            "unused": ["a", "b", "c"],
        }
    )
    pq.write_table(table, tmp_path / "a.bin")
    loaded = load_recordings([tmp_path], columns=column_map, cache=False)
    assert loaded.failed == []
    check(loaded.flights[0])


def test_streams_stand_on_their_own_rows_and_text_is_reported(tmp_path):
    (tmp_path / "columns.toml").write_text(
        'schema = "nanobench-columns/1"\ntime = {column = "us", unit = "us"}\n'
        '[streams.battery]\nvbat = {column = "V", unit = "mV"}\n'
        '[streams.motor]\nm1 = {column = "rpm_1", unit = "rpm"}\n'
    )
    rows = [
        "us,V,rpm_1",
        *(f"{1772689631000000 + 10000 * i},{3900 + i % 7 if i % 5 == 0 else ''},{600 + i * i}" for i in range(50)),
    ]
    rows[8] = rows[8].rpartition(",")[0] + ",stuck"
    (tmp_path / "a.csv").write_text("\n".join(rows) + "\n")
    loaded = load_recordings([tmp_path], columns=tmp_path / "columns.toml", cache=False)
    flight = loaded.flights[0]
    assert loaded.failed == []
    assert len(flight["battery"]) == 10
    assert flight["battery"]["vbat"][1] == pytest.approx(3.905)
    assert len(flight["rpm"]) == 50
    assert np.isnan(flight["rpm"]["m1"][7])
    assert flight["rpm"]["m1"][0] == pytest.approx(20 * math.pi)
    assert flight.epoch_s == pytest.approx(1772689631.0)
    (fault,) = flight.provenance.findings
    assert (fault.kind, fault.stream) == ("bad_cell", "rpm")
    assert "row 8 (line 9): text 'stuck'" in fault.evidence


def test_interpolated_rows_of_a_table_do_not_count(tmp_path):
    rng = np.random.default_rng(3)
    knots, t = np.arange(0.0, 20.01, 0.1), np.arange(0.0, 20.0, 0.01)
    values = np.interp(t, knots, rng.normal(size=len(knots)))
    (tmp_path / "columns.toml").write_text(
        'schema = "nanobench-columns/1"\ntime = "t"\n[streams.mocap]\npx = "x"\n[streams.battery]\nvbat = "held"\n'
    )
    pq.write_table(pa.table({"t": t, "x": values, "held": np.repeat(rng.normal(size=100), 20)}), tmp_path / "a.parquet")
    flight = load_recordings([tmp_path], columns=tmp_path / "columns.toml", cache=False).flights[0]
    assert flight["mocap"].samples == pytest.approx(200, rel=0.05)
    assert flight["battery"].samples == pytest.approx(100, rel=0.05)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"nanobench-columns/1"', '"other/1"', "line 1, schema: schema is 'other/1'"),
        ('time = {column = "t", unit = "s"}', "", "time: the map names no time column"),
        ('unit = "s"', 'unit = "day"', "line 2, time.unit: unit 'day'; here: s, ms, us, ns"),
        ("[streams.imu]", "[streams.imus]", "line 7, streams.imus: unknown stream"),
        ("gyro_x =", "gyro_q =", "line 8, streams.imu.gyro_q: unknown quantity; did you mean 'gyro_z'. imu has acc_x"),
        ('unit = "deg/s"', 'unit = "m"', "line 8, streams.imu.gyro_x.unit: unit 'm'"),
        ("sign = -1", "sign = 2", "line 8, streams.imu.gyro_x.sign: sign 2"),
        ("index = 3}", "index = -3}", "line 6, streams.mocap.qw.index: index -3"),
        ('column = "T_sp"', 'colum = "T_sp"', "line 10, streams.command.thrust.colum: unknown key"),
        ('"custom"', '"custom', "bad TOML: .* line 12"),
    ],
)
def test_errors_name_key_and_line(tmp_path, old, new, words):
    path = tmp_path / "columns.toml"
    path.write_text(MAP.replace(old, new))
    with pytest.raises(InputError, match=words) as caught:
        read_column_map(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"t": [1.0, 2.0], "p": [1.0, 2.0]}, "column p: its cells hold single values"),
        ({"t": [1.0, 2.0], "T_sp": [True, False]}, "column T_sp: holds bool"),
        ({"x": [1.0]}, "column t: is not there"),
        ({"t": [1.0]}, "no column of"),
        ({"t": pa.array([], pa.float64())}, "without rows"),
        (
            {"t": [1.0], "p": [[1.0]], "q": [[1.0, 2.0]]},
            "column p: no cell has an element 1|column q: no cell has an element 3",
        ),
    ],
)
def test_tables_that_do_not_fit_the_map(tmp_path, column_map, table, words):
    pq.write_table(pa.table(table), tmp_path / "a.parquet")
    (failure,) = load_recordings([tmp_path], columns=column_map, cache=False).failed
    assert failure["path"].endswith("a.parquet")
    assert __import__("re").search(words, failure["error"]), failure["error"]


def test_damaged_parquet(tmp_path, column_map):
    (tmp_path / "a").write_bytes(b"PAR1" + bytes(range(200)))
    (failure,) = load_recordings([tmp_path], columns=column_map, cache=False).failed
    assert "cannot be read as Parquet" in failure["error"]


WORKBOOK_ROWS = [["time [s]", "x [mm]", "y [mm]", "z [mm]", "vbat [V]"],
                 *([0.01 * k, 100.0 + k, -50.0 + 0.5 * k, 1000.0 + k % 7, 4.1 - 0.001 * k] for k in range(200))]


def workbook(path, **sheets):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.remove(book.active)
    for title, rows in sheets.items():
        sheet = book.create_sheet(title)
        for row in rows:
            sheet.append(row)
    book.save(path)
    return path


def test_a_workbook_of_one_sheet_is_a_table(tmp_path):
    path = workbook(tmp_path / "flight.xlsx", flight=WORKBOOK_ROWS, empty=[])
    (tmp_path / "map.toml").write_text(draft_columns(path).text)
    (flight,) = load_recordings([path], columns=tmp_path / "map.toml", cache=False).flights
    rows = np.array(WORKBOOK_ROWS[1:])
    np.testing.assert_allclose(flight["mocap"].time_s, rows[:, 0], atol=1e-12)
    np.testing.assert_allclose(flight["mocap"].values, rows[:, 1:4] / 1000.0, atol=1e-12)
    np.testing.assert_allclose(flight["battery"]["vbat"], rows[:, 4], atol=1e-12)


def test_a_workbook_of_two_sheets_is_refused_and_lists_them(tmp_path):
    path = workbook(tmp_path / "flights.xlsx", first=WORKBOOK_ROWS, second=WORKBOOK_ROWS)
    with pytest.raises(InputError, match=r"2 sheets that have cells \(first, second\); save the sheet"):
        draft_columns(path)


def test_without_openpyxl_the_error_gives_the_command_that_installs_it(tmp_path, monkeypatch):
    path = workbook(tmp_path / "flight.xlsx", flight=WORKBOOK_ROWS)
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    with pytest.raises(InputError, match=r"read through openpyxl; .*pip install"):
        draft_columns(path)
