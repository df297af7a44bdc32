"""NanoBench CSV and sheet: units, missing and extra columns, sheets matched by time, round trip."""

from __future__ import annotations

import gzip
import lzma
from dataclasses import replace

import numpy as np
import pytest
from source_samples import EPOCH, NAMES, SHEET, TO_SI, csv_text, table

from nanobench_tools import InputError
from nanobench_tools.sources import load_recordings, write_nanobench
from nanobench_tools.sources.nanobench import NanoBench
from nanobench_tools.sources.nanobench_columns import COLUMN_NAMES

VALUES = table()


def load(folder, **kwargs):
    return load_recordings([folder], cache=False, **kwargs)


def kinds(flight):
    return {f.kind for f in flight.provenance.findings}


def test_column_names_are_those_of_the_format():
    assert list(COLUMN_NAMES) == NAMES


@pytest.mark.parametrize("pack", [lambda b: b, gzip.compress, lzma.compress])
def test_every_column_arrives_in_si(tmp_path, pack):
    (tmp_path / "x").write_bytes(pack(csv_text(VALUES).encode()))
    flight = load(tmp_path).flights[0]
    assert flight.epoch_s == EPOCH
    assert kinds(flight) == set()
    seen = set()
    for stream in flight.streams.values():
        for column in stream.columns:
            right = VALUES[:, NAMES.index(column)] * TO_SI.get(column, 1.0)
            np.testing.assert_allclose(stream[column], right, rtol=1e-13)
            seen.add(column)
    assert seen == set(NAMES) - {"t"}
    np.testing.assert_array_equal(flight["mocap"].time_s + flight.epoch_s, VALUES[:, 0])


def test_sheet_is_found_by_time_and_gives_true_counts(tmp_path):
    (tmp_path / "named_at_random.csv").write_text(csv_text(VALUES))
    (tmp_path / "something_else.yml").write_text(SHEET)
    flight = load(tmp_path).flights[0]
    assert flight["imu"].samples == 55
    assert flight["battery"].samples == 6
    assert flight["pid"].samples == 57
    assert flight["mocap"].samples == 60
    assert flight["imu"].rate_hz == pytest.approx(55 / flight["imu"].span.duration_s, rel=0.05)
    assert (flight.metadata["family"], flight.metadata["speed"]) == ("trefoil", "fast")
    assert flight.metadata["reference_speed_m_s"] == 1.0
    assert flight.metadata["start_unix_s"] == 1772689631.0
    assert not flight.provenance.synthetic


def test_counts_of_the_sheet_are_not_used_for_a_file_that_was_cut(tmp_path):
    (tmp_path / "a.csv").write_text(csv_text(VALUES[:25]))
    (tmp_path / "a_metadata.yaml").write_text(SHEET)
    flight = load(tmp_path).flights[0]
    assert flight["imu"].samples <= 25
    assert [f.evidence for f in flight.provenance.findings if f.kind == "truncated"] == [
        "the last row is 0.16 s or more before the end that the sheet states, and there are 25 of its 60 rows"
    ]


@pytest.mark.parametrize("rows", [[*range(20), *range(40, 60)], range(0, 60, 2), range(59)])
def test_rows_that_are_missing_elsewhere_do_not_end_a_file_early(tmp_path, rows):
    (tmp_path / "a.csv").write_text(csv_text(VALUES[list(rows)]))
    (tmp_path / "a_metadata.yaml").write_text(SHEET)
    flight = load(tmp_path).flights[0]
    assert flight.metadata["trajectory_id"] == "B9_trefoil_fast"
    assert kinds(flight) == set()


@pytest.mark.parametrize("end", ["", "recording_end_utc: unknown\n"])
def test_a_sheet_without_an_end_proves_no_cut(tmp_path, end):
    (tmp_path / "a.csv").write_text(csv_text(VALUES[:25]))
    (tmp_path / "a_metadata.yaml").write_text(SHEET.replace("recording_end_utc: 20260305T054712Z\n", end))
    assert kinds(load(tmp_path).flights[0]) == set()


def test_slice_takes_family_but_no_counts(tmp_path):
    later = VALUES.copy()
    later[:, 0] += 5.0
    sheet = SHEET.replace("T054712Z", "T054753Z")
    (tmp_path / "a.csv").write_text(csv_text(later))
    (tmp_path / "b_metadata.yaml").write_text(sheet)
    flight = load(tmp_path).flights[0]
    assert flight.metadata["family"] == "trefoil"
    assert flight["imu"].samples == 60
    assert kinds(flight) == set()


def test_sheet_of_another_time_is_left_alone(tmp_path):
    (tmp_path / "a.csv").write_text(csv_text(VALUES))
    (tmp_path / "a_metadata.yaml").write_text(SHEET.replace("20260305", "20260306"))
    assert load(tmp_path).flights[0].metadata["family"] is None


def test_sheet_without_times_belongs_to_the_file_beside_it(tmp_path):
    (tmp_path / "a.csv").write_text(csv_text(VALUES))
    (tmp_path / "b.csv").write_text(csv_text(VALUES[:50]))
    (tmp_path / "b_metadata.yaml").write_text(
        "trajectory_type: circle\ntrajectory_id: B2_circle_slow\nsynthetic: true\n"
    )
    a, b = load(tmp_path).flights
    assert (a.metadata["family"], b.metadata["family"], b.metadata["speed"]) == (None, "circle", "slow")
    assert (a.provenance.synthetic, b.provenance.synthetic) == (False, True)


def test_missing_extra_and_empty_columns(tmp_path):
    names = [n for n in NAMES if n not in ("imu_gyro_z", "pwr_pm_vbat")]
    rows = [[f"{v:.9f}" for n, v in zip(NAMES, row, strict=True) if n in names] for row in VALUES]
    for i, row in enumerate(rows):
        row[names.index("sp_ctrltarget_x")] = ""
        row += [f"{i}.5", "a note"]
    (tmp_path / "a.csv").write_text("\n".join(",".join(r) for r in [[*names, "wind", "comment"], *rows]) + "\n")
    flight = load(tmp_path).flights[0]
    missing = {c for f in flight.provenance.findings if f.kind == "missing_column" for c in f.columns}
    extra = {c for f in flight.provenance.findings if f.kind == "extra_column" for c in f.columns}
    assert missing == {"imu_gyro_z", "pwr_pm_vbat", "sp_ctrltarget_x"}
    assert extra == {"wind", "comment"}
    assert kinds(flight) == {"missing_column", "extra_column"}
    assert "battery" not in flight
    assert flight["imu"].columns == tuple(n for n in NAMES if n.startswith("imu_") and n != "imu_gyro_z")
    np.testing.assert_allclose(flight["extra"]["wind"], np.arange(60) + 0.5)


@pytest.mark.parametrize("rate_hz", [20.0, 500.0])
def test_other_rates(tmp_path, rate_hz):
    values = VALUES.copy()
    values[:, 0] = EPOCH + np.arange(60) / rate_hz
    (tmp_path / "a.csv").write_text(csv_text(values))
    flight = load(tmp_path).flights[0]
    assert flight["mocap"].rate_hz == pytest.approx(rate_hz, rel=0.03)
    assert kinds(flight) == set()


def test_bad_cell_names_stream_column_row_and_line(tmp_path):
    text = csv_text(VALUES).split("\n")
    cells = text[13].split(",")
    cells[NAMES.index("imu_acc_y")] = "oops"
    text[13] = ",".join(cells)
    (tmp_path / "a.csv").write_text("\n".join(text))
    flight = load(tmp_path).flights[0]
    (fault,) = flight.provenance.findings
    assert (fault.kind, fault.stream, fault.columns, fault.size) == ("bad_cell", "imu", ("imu_acc_y",), 1.0)
    assert fault.evidence == "column imu_acc_y, row 13 (line 14): text 'oops' where a number belongs"
    assert np.isnan(flight["imu"]["imu_acc_y"][12])
    time_s = flight["imu"].time_s
    assert fault.span.mask(time_s).tolist() == [i == 12 for i in range(60)]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "the file is empty"),
        ("t,px,py,pz,wx_vicon\n", "there is a header but no row"),
        ("px,py,pz,wx_vicon\n1,2,3,4\n", "column t: is not in the file"),
        ("t,px,py,pz,pwr_pm_vbat\nx,1,2,3,4\n", "column t: holds no number"),
        ("t,wx_vicon,wy_vicon,wz_vicon\n1,0,1,5,2,5,3,5\n2,0,1,5,2,5,3,5\n", "no row fits the header: 8 cells"),
    ],
)
def test_no_recording_in_one_line(tmp_path, text, words):
    (tmp_path / "a.csv").write_text(text)
    (failure,) = load(tmp_path).failed
    assert failure["path"] == str(tmp_path / "a.csv")
    assert failure["error"].startswith(str(tmp_path / "a.csv"))
    assert words in failure["error"]


def test_single_row(tmp_path):
    (tmp_path / "a.csv").write_text(csv_text(VALUES[:1]))
    flight = load(tmp_path).flights[0]
    assert len(flight["mocap"]) == 1
    assert np.isnan(flight["mocap"].rate_hz)


@pytest.mark.parametrize("name", ["out.csv", "out.csv.gz", "out.csv.xz"])
def test_round_trip_to_print_rounding(tmp_path, name):
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "a.csv").write_text(csv_text(VALUES))
    (tmp_path / "in" / "a_metadata.yaml").write_text(SHEET)
    before = load(tmp_path / "in").flights[0]
    write_nanobench(before, tmp_path / "out" / name)
    after = load(tmp_path / "out").flights[0]
    assert after.epoch_s == before.epoch_s
    assert set(after.streams) == set(before.streams)
    for key, stream in before.streams.items():
        np.testing.assert_array_equal(after[key].time_s, stream.time_s)
        np.testing.assert_allclose(after[key].values, stream.values, atol=0.51e-9 * 9.81, rtol=0)
        assert after[key].samples == stream.samples
        assert (after[key].columns, after[key].quantities, after[key].unit) == (
            stream.columns,
            stream.quantities,
            stream.unit,
        )
    assert {k: v for k, v in after.metadata.items() if k != "row_counts"} == {
        k: v for k, v in before.metadata.items() if k != "row_counts"
    }
    text = (tmp_path / "out" / name).read_bytes()
    unpacked = {".gz": gzip.decompress, ".xz": lzma.decompress}.get((tmp_path / name).suffix, bytes)(text)
    assert unpacked.decode() == csv_text(VALUES)


def test_round_trip_of_other_clocks_and_synthetic(tmp_path):
    (tmp_path / "a.csv").write_text(csv_text(VALUES))
    flight = load(tmp_path).flights[0]
    battery = flight["battery"].rows(np.arange(5, 50, 9))
    flight = replace(
        flight.with_streams(battery=battery).without_streams("pid"),
        provenance=replace(flight.provenance, synthetic=True),
        metadata={"family": "star", "speed": "slow", "reference_speed_m_s": 0.5, "duration_s": 30.0},
    )
    write_nanobench(flight, tmp_path / "out" / "b.csv")
    after = load(tmp_path / "out").flights[0]
    assert after.provenance.synthetic
    assert (after.metadata["family"], after.metadata["speed"], after.metadata["duration_s"]) == ("star", "slow", 30.0)
    assert after["battery"].samples == 5
    inside = (after["battery"].time_s >= battery.time_s[0]) & (after["battery"].time_s <= battery.time_s[-1])
    np.testing.assert_allclose(
        after["battery"]["vbat"][inside],
        np.interp(flight["mocap"].time_s[inside], battery.time_s, battery["vbat"]),
        atol=1e-9,
    )
    assert np.isnan(after["battery"]["vbat"][~inside]).all()
    assert "pid" not in after


def test_writer_names_a_place_it_cannot_write(tmp_path):
    (tmp_path / "a.csv").write_text(csv_text(VALUES))
    flight = load(tmp_path).flights[0]
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match=r"file/b\.csv: cannot be written"):
        write_nanobench(flight, tmp_path / "file" / "b.csv")
    with pytest.raises(InputError, match="has no rows"):
        write_nanobench(replace(flight, streams={}), tmp_path / "c.csv")


def test_recognised_by_content_alone():
    source = NanoBench()
    assert source.recognises("anything", csv_text(VALUES).encode()[:8192])
    assert not source.recognises("x.csv", b"a,b,c\n1,2,3\n")
    assert not source.recognises("x.csv", b"")
