"""What is found where, in which order and under which name; the cache."""

from __future__ import annotations

import os
import random

import numpy as np
import pytest
from source_samples import EPOCH, SHEET, csv_text, table, usd_log

from nanobench_tools import InputError
from nanobench_tools.sources import cache, default_data, find_recordings, load_recordings, read
from nanobench_tools.sources.companions import companion
from nanobench_tools.sources.nanobench import NanoBench

LICENCE = (
    "Permission is hereby granted, free of charge, to any person obtaining a copy of this software, to deal in it.\n"
    * 4
)


@pytest.fixture(autouse=True)
def own_cache(tmp_path_factory, monkeypatch):
    folder = tmp_path_factory.mktemp("cache")
    monkeypatch.setenv("NANOBENCH_CACHE", str(folder))
    return folder


@pytest.fixture
def folder(tmp_path):
    place = tmp_path / "data"
    (place / "a" / "deep").mkdir(parents=True)
    (place / "b").mkdir()
    (place / "a" / "flight.csv").write_text(csv_text(table(seed=1)))
    (place / "a" / "deep" / "log00").write_bytes(usd_log().data)
    (place / "b" / "flight.txt").write_text(csv_text(table(seed=2)))
    (place / "b" / "other.csv").write_text(csv_text(table(seed=3)))
    (place / "LICENSE").write_text(LICENCE)
    (place / "a" / "config.txt").write_text("1 # version\n512\nlog\n0\non:fixedFrequency\n500\n1\ngyro.x\n")
    (place / "labels.toml").write_text('schema = "nanobench-labels/1"\n[folders.normal]\ncause = "normal"\n')
    (place / ".hidden").write_bytes(b"\x00\x01")
    return place


def test_recursive_sorted_by_content(folder):
    loaded = load_recordings([folder])
    assert [f.name for f in loaded.flights] == ["log00", "a.flight", "b.flight", "other"]
    assert [f.provenance.source for f in loaded.flights] == ["usd", "nanobench", "nanobench", "nanobench"]
    assert loaded.failed == []


def test_files_keep_the_order_in_which_they_are_given(folder):
    given = [folder / "b" / "other.csv", folder / "a" / "deep" / "log00", folder / "a" / "flight.csv"]
    assert [f.name for f in load_recordings(given).flights] == ["other", "log00", "flight"]


def test_order_and_result_do_not_depend_on_the_file_system_or_jobs(folder, monkeypatch):
    right = load_recordings([folder])
    walk = os.walk

    def shuffled(*args, **kwargs):
        for place, folders, names in walk(*args, **kwargs):
            random.shuffle(folders)
            random.shuffle(names)
            yield place, folders, names

    monkeypatch.setattr(os, "walk", shuffled)
    done = []
    other = load_recordings(
        [folder / "b", folder, folder / "a" / "flight.csv"], jobs=2, progress=lambda *a: done.append(a)
    )
    assert sorted(f.provenance.path for f in other.flights) == sorted(f.provenance.path for f in right.flights)
    assert {f.provenance.sha256 for f in other.flights} == {f.provenance.sha256 for f in right.flights}
    assert [d[:2] for d in done] == [(1, 4), (2, 4), (3, 4), (4, 4)]


def test_renaming_every_file_changes_nothing_but_names(tmp_path):
    (tmp_path / "x").mkdir()
    (tmp_path / "x" / "B9_trefoil_fast_rep1.csv").write_text(csv_text(table()))
    (tmp_path / "x" / "B9_trefoil_fast_rep1_metadata.yaml").write_text(SHEET)
    before = load_recordings([tmp_path / "x"]).flights[0]
    (tmp_path / "x" / "B9_trefoil_fast_rep1.csv").rename(tmp_path / "x" / "B2_circle_slow_rep9")
    (tmp_path / "x" / "B9_trefoil_fast_rep1_metadata.yaml").rename(tmp_path / "x" / "000.csv")
    after = load_recordings([tmp_path / "x"]).flights[0]
    assert (before.name, after.name) == ("B9_trefoil_fast_rep1", "B2_circle_slow_rep9")
    assert after.metadata == before.metadata
    assert {k: (v.samples, v.rate_hz) for k, v in after.streams.items()} == {
        k: (v.samples, v.rate_hz) for k, v in before.streams.items()
    }


def test_strangers_are_listed_with_one_line(tmp_path):
    (tmp_path / "good.csv").write_text(csv_text(table()))
    (tmp_path / "picture.csv").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(range(256)))
    (tmp_path / "table.csv").write_text("a,b,c\n" + "1,2,3\n" * 50)
    (tmp_path / "short.txt").write_text("not a recording\n")
    (tmp_path / "empty").write_bytes(b"")
    (tmp_path / "gone").symlink_to(tmp_path / "nowhere")
    os.mkfifo(tmp_path / "pipe")
    loaded = load_recordings([tmp_path])
    assert [f.name for f in loaded.flights] == ["good"]
    assert [os.path.basename(f["path"]) for f in loaded.failed] == [
        "empty",
        "gone",
        "picture.csv",
        "pipe",
        "short.txt",
        "table.csv",
    ]
    assert all(f["error"].startswith(f["path"]) and "\n" not in f["error"] for f in loaded.failed)


def test_companions():
    assert companion(SHEET.encode()) == "sheet"
    assert companion(LICENCE.encode()) == "prose"
    assert companion(b'{"schema": "nanobench-audit/1", "flights": []}') == "json"
    assert companion(b"# Data\n\n## jana00\n" + b"HEIGHT = 0.7 metres above ground\n" * 12) == "prose"
    assert companion(csv_text(table()).encode()) is None
    assert companion(b"cam0:\n  camera_model: pinhole\n  resolution: [640, 480]\n") == "calibration of Kalibr"
    assert companion(b"1 2 3\n4 5 6\n") is None
    assert companion(b"{broken json that goes on") is None


def test_places_that_cannot_be_used(tmp_path, monkeypatch):
    with pytest.raises(InputError, match="there is no such file or folder"):
        load_recordings([tmp_path / "missing"])
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="empty: no recording in it"):
        load_recordings([tmp_path / "empty"])
    (tmp_path / "empty" / "columns.json").write_text('{"t": [0.0, 0.1]}')
    with pytest.raises(InputError, match=r"no recording in it, only what lies next to recordings \(json\)"):
        load_recordings([tmp_path / "empty" / "columns.json"])
    (tmp_path / "some" / "locked").mkdir(parents=True)
    (tmp_path / "some" / "a.csv").write_text(csv_text(table()))
    scandir = os.scandir

    def refuse(path="."):
        if str(path).endswith("locked"):
            raise PermissionError(13, "Permission denied", str(path))
        return scandir(path)

    monkeypatch.setattr(os, "scandir", refuse)
    loaded = load_recordings([tmp_path / "some"])
    assert len(loaded.flights) == 1
    assert loaded.failed[0]["error"].startswith(f"{tmp_path / 'some' / 'locked'}: cannot be listed (Permission denied)")


def test_default_places(tmp_path, monkeypatch):
    (tmp_path / "project" / "data").mkdir(parents=True)
    (tmp_path / "shared" / "data" / "nanobench").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "project")
    monkeypatch.setenv("NANOBENCH_DATA", "/somewhere")
    assert [str(p) for p in default_data()] == ["/somewhere"]
    monkeypatch.delenv("NANOBENCH_DATA")
    assert [str(p) for p in default_data()] == ["data"]
    (tmp_path / "project" / "data").rmdir()
    assert [str(p) for p in default_data()] == ["../shared/data/nanobench"]
    (tmp_path / "shared" / "data" / "nanobench").rmdir()
    assert default_data() is None


def same(a, b):
    assert (a.name, a.metadata, a.epoch_s, repr(a.provenance)) == (b.name, b.metadata, b.epoch_s, repr(b.provenance))
    assert list(a.streams) == list(b.streams)
    for x, y in zip(a.streams.values(), b.streams.values(), strict=True):
        np.testing.assert_array_equal(x.time_s, y.time_s)
        np.testing.assert_array_equal(x.values, y.values)
        assert (x.columns, x.quantities, x.unit, x.frame, x.samples, x.valid) == (
            y.columns,
            y.quantities,
            y.unit,
            y.frame,
            y.samples,
            y.valid,
        )
        assert x.rate_hz == y.rate_hz or (np.isnan(x.rate_hz) and np.isnan(y.rate_hz))


def test_cached_flight_is_the_flight(folder, monkeypatch):
    (folder / "b" / "broken.csv").write_text(csv_text(table()).replace("3.", "x.", 5))
    fresh = load_recordings([folder], cache=False).flights
    first = load_recordings([folder]).flights
    monkeypatch.setattr(NanoBench, "read", lambda *a: pytest.fail("read although it was in the cache"))
    for a, b, c in zip(fresh, first, load_recordings([folder]).flights, strict=True):
        same(a, b)
        same(b, c)


def test_damaged_or_foreign_entry_is_read_again(tmp_path, own_cache):
    (tmp_path / "a.csv").write_text(csv_text(table()))
    recording = find_recordings([tmp_path])[0][0]
    right = read(recording)
    (entry,) = own_cache.rglob("*.parquet")
    whole = entry.read_bytes()
    for seed in range(60):
        rng = np.random.default_rng(seed)
        data = bytearray(whole)
        if seed % 3 == 0:
            data = data[: int(rng.integers(0, len(data)))]
        else:
            at = int(rng.integers(0, len(data)))
            data[at : at + 8] = rng.integers(0, 256, 8, dtype=np.uint8).tobytes()
        entry.write_bytes(bytes(data))
        same(read(recording), right)


def test_entry_is_keyed_by_content_and_version(tmp_path, own_cache, monkeypatch):
    (tmp_path / "a.csv").write_text(csv_text(table()))
    (tmp_path / "copy.csv").write_text(csv_text(table()))
    load_recordings([tmp_path])
    assert len(list(own_cache.rglob("*.parquet"))) == 1
    monkeypatch.setattr(NanoBench, "version", NanoBench.version + 1)
    load_recordings([tmp_path])
    assert len(list(own_cache.rglob("*.parquet"))) == 2
    (tmp_path / "a.csv").write_text(csv_text(table(seed=9)))
    assert load_recordings([tmp_path]).flights[0].epoch_s == EPOCH
    assert len(list(own_cache.rglob("*.parquet"))) == 3
    assert not [p for p in own_cache.rglob(".*") if p.is_file()]


def test_cache_that_cannot_be_written_is_done_without(tmp_path, monkeypatch):
    (tmp_path / "a.csv").write_text(csv_text(table()))
    (tmp_path / "file").write_text("x")
    monkeypatch.setenv("NANOBENCH_CACHE", str(tmp_path / "file" / "cache"))
    assert cache.cache_folder() == tmp_path / "file" / "cache"
    assert len(load_recordings([tmp_path / "a.csv"]).flights) == 1


def test_a_source_that_breaks_does_not_take_the_others_with_it(folder, monkeypatch):
    monkeypatch.setattr(NanoBench, "read", lambda *a: 1 / 0)
    loaded = load_recordings([folder], cache=False)
    assert [f.name for f in loaded.flights] == ["log00"]
    assert "source nanobench failed, ZeroDivisionError" in loaded.failed[0]["error"]


def test_archives_that_are_cut_or_damaged(tmp_path):
    import gzip
    import lzma

    whole = csv_text(table()).encode()
    for pack in (gzip.compress, lzma.compress):
        packed = pack(whole)
        for share in (0.3, 0.6, 0.9):
            (tmp_path / "a").write_bytes(packed[: int(share * len(packed))])
            loaded = load_recordings([tmp_path / "a"], cache=False)
            for flight in loaded.flights:
                assert [f.kind for f in flight.provenance.findings].count("truncated") == 1
                n = len(flight["mocap"])
                np.testing.assert_array_equal(flight["mocap"]["px"], table()[:n, 1])
            assert loaded.flights or "\n" not in loaded.failed[0]["error"]
        data = bytearray(packed)
        data[len(data) // 2] ^= 0xFF
        (tmp_path / "a").write_bytes(bytes(data))
        loaded = load_recordings([tmp_path / "a"], cache=False)
        assert loaded.flights == []
        assert "damaged" in loaded.failed[0]["error"]


def test_a_file_named_alone_keeps_its_sheet(tmp_path, crowd):
    from nanobench_tools.sources.nanobench_writer import write_nanobench

    path = tmp_path / "flight.csv"
    write_nanobench(crowd.flight("short circle"), path)
    alone = load_recordings([path], cache=False).flights[0]
    assert alone.provenance.synthetic
    assert alone.metadata["family"] == load_recordings([tmp_path], cache=False).flights[0].metadata["family"]


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"- 1\n- 2\n", "holds a list"),
        (b"a: [1,2\n b: }{\x00\n", "no YAML"),
        (b"trajectory_id: x\nrow_counts: {imu: 3\x00}\n", "no YAML"),
        (b"trajectory_id: x\nrow_counts: [\n", "no YAML"),
        (b"colour: red\n", "none of the keys"),
        (b"\xff\xfe\x00", "UTF-8"),
    ],
)
def test_a_bad_sheet_is_named_as_such_and_its_recording_is_read(tmp_path, content, why):
    (tmp_path / "flight.csv").write_text(csv_text(table()))
    (tmp_path / "flight_metadata.yaml").write_bytes(content)
    loaded = load_recordings([tmp_path], cache=False)
    assert [f.name for f in loaded.flights] == ["flight"]
    (failed,) = loaded.failed
    assert "flight_metadata.yaml" in failed["error"]
    assert "bad sheet" in failed["error"]
    assert why in failed["error"]
    assert failed["error"].endswith("the recording is read without it")
    assert "\n" not in failed["error"]
