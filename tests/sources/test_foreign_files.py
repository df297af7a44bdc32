"""No source takes another format's file for its own; what is refused is refused with the columns seen."""

from __future__ import annotations

import bz2
import functools
import gzip
import io
import lzma
import zipfile

import numpy as np
import pytest
from foreign_files import EPOCH_NS, FOREIGN, STEP_NS, idsia, path, tum
from hypothesis import HealthCheck, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from source_samples import NAMES, TO_SI, csv_text, table, usd_log

from nanobench_tools.sources import load_recordings, write_nanobench
from nanobench_tools.sources.discover import sources
from nanobench_tools.sources.payload import HEAD_BYTES

VALUES = table(12)
IDSIA_MAP = """schema = "nanobench-columns/1"
time = {column = "t", unit = "s"}
[streams.mocap]
px = "x_poses"
py = "y_poses"
pz = "z_poses"
[streams.attitude_qw]
qx = "qx"
qy = "qy"
qz = "qz"
qw = "qw"
[streams.battery]
vbat = "Vbat"
"""


def load(place, data, **more):
    (place / "a").write_bytes(data)
    return load_recordings([place / "a"], cache=False, **more)


def alone_in_a_zip(data):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("folder/file.txt", data)
    return file.getvalue()


def encoded(encoding, data):
    return data.decode().encode(encoding)


@pytest.mark.parametrize("name", FOREIGN)
def test_one_source_or_none(tmp_path, name):
    foreign = FOREIGN[name]
    asked = {n: s.recognises(tmp_path / "a", foreign.data[:HEAD_BYTES]) for n, s in sources().items()}
    assert [n for n, yes in asked.items() if yes] == ([foreign.source] if foreign.source else [])
    loaded = load(tmp_path, foreign.data)
    assert len(loaded.flights) == (foreign.source is not None)
    for failure in loaded.failed:
        assert "not a recording of any known format" in failure["error"]
        assert "\n" not in failure["error"]
        assert all(word in failure["error"] for word in foreign.seen), failure["error"]
        assert not foreign.seen or "--columns" in failure["error"]


@pytest.mark.parametrize("name", ["TUM of open_vins", "EuRoC truth", "UZH-FPV truth, 8 cells"])
@pytest.mark.parametrize("packed", [bz2.compress, gzip.compress, lzma.compress, alone_in_a_zip,
                                    *(functools.partial(encoded, f"utf-16{kind}") for kind in ("", "-le", "-be"))])
def test_packed_files_and_texts_of_two_bytes_a_letter_are_the_same_recording(tmp_path, name, packed):
    (plain,) = load(tmp_path, FOREIGN[name].data).flights
    (flight,) = load(tmp_path, packed(FOREIGN[name].data)).flights
    assert flight.provenance.source == plain.provenance.source
    np.testing.assert_array_equal(flight["mocap"].values, plain["mocap"].values)


def test_files_of_other_programs_are_named(tmp_path):
    workbook = io.BytesIO()
    with zipfile.ZipFile(workbook, "w") as archive:
        archive.writestr("[Content_Types].xml", "<Types/>")
        archive.writestr("xl/workbook.xml", "<workbook/>")
    open_document = io.BytesIO()
    with zipfile.ZipFile(open_document, "w") as archive:
        archive.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet")
        archive.writestr("content.xml", "<content/>")
    for data, what in ((workbook.getvalue(), "save its sheet as CSV"),
                       (open_document.getvalue(), "a workbook: save its sheet as CSV"),
                       (b"MATLAB 5.0 MAT-file, Platform: GLNXA64" + bytes(90), "a file of MATLAB")):
        assert what in load(tmp_path, data).failed[0]["error"]


@pytest.mark.parametrize("data", [csv_text(VALUES).encode(), usd_log().data])
def test_our_own_formats_are_taken_by_one_source(tmp_path, data):
    assert sum(s.recognises(tmp_path / "a", data[:HEAD_BYTES]) for s in sources().values()) == 1


@pytest.mark.parametrize("name", [n for n, f in FOREIGN.items() if f.source == "tum"])
def test_every_trajectory_is_the_path_that_was_flown(tmp_path, name):
    since, position, turn = path()
    mocap = load(tmp_path, FOREIGN[name].data).flights[0]["mocap"]
    np.testing.assert_allclose(mocap.time_s, since, atol=1e-9)
    np.testing.assert_allclose(mocap["px", "py", "pz"], position, atol=2e-9)
    np.testing.assert_allclose(mocap["qx", "qy", "qz", "qw"], turn, atol=2e-9)


def test_nanoseconds_keep_their_last_digit(tmp_path):
    flight = load(tmp_path, FOREIGN["TUM in nanoseconds"].data).flights[0]
    assert flight.epoch_s == pytest.approx(EPOCH_NS * 1e-9)
    np.testing.assert_array_equal(np.round(flight["mocap"].time_s * 1e9), np.arange(len(flight["mocap"])) * STEP_NS)


def test_columns_beside_a_pose_are_said(tmp_path):
    names = [f.columns[0] for f in load(tmp_path, FOREIGN["UZH-FPV truth with id"].data).flights[0].provenance.findings]
    assert names == ["id"]
    assert load(tmp_path, FOREIGN["UZH-FPV truth, 8 cells"].data).flights[0].provenance.findings == ()


@pytest.mark.parametrize(
    "data",
    [
        tum("", integer=True),
        tum("# timestamp tx ty tz qx qy qz qw", integer=True),
        tum("# timestamp(s) tx ty tz qx qy qz qw", integer=True),
        tum("", unit=1e-3, start=1.7e9),
        tum("", unit=1e-6),
    ],
    ids=["ns", "ns, names", "ns that call themselves s", "ms since 1970", "us since boot"],
)
def test_stamps_that_are_no_seconds_are_refused(tmp_path, data):
    (failure,) = load(tmp_path, data).failed
    assert "no seconds" in failure["error"]
    assert "[ns]" in failure["error"]


@pytest.mark.parametrize("scale", [1e3, 1e6, 1e9])
def test_a_nanobench_file_in_another_unit_of_time_is_refused(tmp_path, scale):
    for epoch in (0.0, 1772689631.0):
        values = VALUES.copy()
        values[:, 0] = (epoch + 0.01 * np.arange(len(values))) * scale
        (failure,) = load(tmp_path, csv_text(values).encode()).failed
        assert "column t" in failure["error"]


def test_what_is_refused_is_read_through_a_map(tmp_path):
    (tmp_path / "columns.toml").write_text(IDSIA_MAP)
    loaded = load(tmp_path, idsia(), columns=tmp_path / "columns.toml")
    assert loaded.failed == []
    since, position, turn = path()
    flight = loaded.flights[0]
    assert set(flight.streams) == {"mocap", "attitude_qw", "battery"}
    np.testing.assert_allclose(flight["mocap"].time_s, since, atol=1e-9)
    np.testing.assert_allclose(flight["mocap"]["px", "py", "pz"], position, atol=1e-7)
    np.testing.assert_allclose(flight["attitude_qw"]["qx", "qy", "qz", "qw"], turn, atol=1e-7)


def test_a_wrong_time_column_of_a_map_is_called_by_its_name(tmp_path):
    (tmp_path / "columns.toml").write_text(IDSIA_MAP.replace('"t"', '"stamp"'))
    (failure,) = load(tmp_path, FOREIGN["own pose table"].data, columns=tmp_path / "columns.toml").failed
    assert f"the time column stamp of {tmp_path / 'columns.toml'} is not there" in failure["error"]
    assert "its columns: t, px" in failure["error"]
    (tmp_path / "columns.toml").write_text(IDSIA_MAP.replace('"t"', '"stamp"'))
    (failure,) = load(tmp_path, FOREIGN["own table of other names"].data, columns=tmp_path / "columns.toml").failed
    assert "only the time stamp is there" in failure["error"]


OTHER_NAMES = ("x", "y", "z", "x_poses", "ax", "wx", "PX", "thrust", "pwm1", "time", "m1_erpm", "qx_mocap", "gyro.x")


@st.composite
def changed(draw):
    """[(name as written, name it had)] of a NanoBench table whose columns were dropped, renamed and moved."""
    kept = draw(st.lists(st.sampled_from(NAMES), unique=True, max_size=52))
    other = draw(st.lists(st.sampled_from(OTHER_NAMES), unique=True, max_size=6))
    return [*zip(other, kept, strict=False), *((n, n) for n in kept[len(other) :])]


@given(changed(), st.randoms(use_true_random=False))
@hypothesis_settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@pytest.mark.slow
def test_dropping_renaming_moving_reads_right_or_is_refused(tmp_path, columns, random):
    random.shuffle(columns)
    names = [new for new, _ in columns]
    data = csv_text(VALUES[:, [NAMES.index(old) for _, old in columns]], names).encode()
    loaded = load(tmp_path, data)
    if not loaded.flights:
        (failure,) = loaded.failed
        assert len(names) < 2 or names[0] in failure["error"] or "column t" in failure["error"]
        return
    seen = set()
    for stream_name, stream in loaded.flights[0].streams.items():
        for column in stream.columns:
            seen.add(column)
            assert (stream_name == "extra") == (column not in NAMES)
            if column in NAMES:
                right = VALUES[:, NAMES.index(column)] * TO_SI.get(column, 1.0)
                np.testing.assert_allclose(stream[column], right, rtol=1e-13)
    assert seen == set(names) - {"t"}


STREAMS = {
    "mocap": NAMES[1:17],
    "motor": NAMES[23:27],
    "estimator": NAMES[27:33],
    "attitude": NAMES[36:43],
    "setpoint": NAMES[43:47],
    "pid": NAMES[47:51],
    "mocap and imu": NAMES[1:23],
}


@pytest.mark.parametrize("stream", STREAMS)
@pytest.mark.parametrize("pack", [bytes, gzip.compress, lzma.compress])
def test_some_streams_and_columns_of_ones_own_are_still_read(tmp_path, stream, pack):
    names = ["t", *STREAMS[stream]]
    values = VALUES[:, [NAMES.index(n) for n in names]]
    values = np.column_stack([values, np.arange(len(values))])
    flight = load(tmp_path, pack(csv_text(values, [*names, "my own"]).encode())).flights[0]
    assert {c for s in flight.streams.values() for c in s.columns} == {*STREAMS[stream], "my own"}
    assert flight.provenance.source == "nanobench"


def test_what_our_own_writer_writes_is_known_again_whatever_it_holds(tmp_path):
    flight = load(tmp_path, tum("")).flights[0]
    again = load_recordings([write_nanobench(flight, tmp_path / "out" / "b.csv")], cache=False).flights[0]
    assert again.provenance.source == "nanobench"
    assert set(again.streams) == {"mocap"}
    assert again["mocap"].quantities == flight["mocap"].quantities
    np.testing.assert_allclose(again["mocap"].values, flight["mocap"].values, atol=1e-9)


def test_a_pose_of_which_nothing_says_whose_it_is_is_refused(tmp_path):
    names = ["t", "vx", "vy", "vz", "motor_motor_m1", "motor_motor_m2"]
    (failure,) = load(tmp_path, csv_text(VALUES[:, [NAMES.index(n) for n in names]], names).encode()).failed
    assert "vx, vy, vz may be the motion capture's or the vehicle's own" in failure["error"]
    assert "its columns: t, vx, vy, vz, motor_motor_m1, motor_motor_m2" in failure["error"]


@pytest.mark.real
@pytest.mark.slow
def test_every_real_file_is_one_sources_own(real_data):
    folders = {"nanobench": "nanobench", "crazyflie_usd": "usd", "crazypad": "usd", "crazyswarm_lee": "usd",
               "sysid_tools": "usd", "stand": "stand"}  # fmt: skip
    from nanobench_tools.sources import find_recordings
    from nanobench_tools.sources.payload import head

    asked = sources().items()
    for folder, source in folders.items():
        recordings, failed = find_recordings([real_data / folder])
        assert failed == []
        for recording in recordings:
            assert [n for n, s in asked if s.recognises(recording.path, head(recording.path))] == [source]
