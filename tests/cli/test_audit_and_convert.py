"""``nanobench audit`` and ``nanobench convert`` on practice recordings."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest

from nanobench_tools.sources.discover import load_recordings
from nanobench_tools.steps.options import Options


def test_audit_writes_the_keys_of_the_contract(nanobench, recordings, tmp_path):
    code, out, err = nanobench("audit", "--data", recordings, "--json", tmp_path / "a.json", "--out", tmp_path / "o",
                               "--jobs", 1)
    assert code == 0
    assert "SYNTHETIC Audit of 3 recordings" in out
    assert "3 SYNTHETIC recordings from" in err
    body = json.loads((tmp_path / "a.json").read_text())
    assert body == json.loads((tmp_path / "o" / "audit.json").read_text())
    assert {"schema", "version", "synthetic", "manifest", "failed", "flights", "copies"} <= set(body)
    assert body["synthetic"] is True
    assert body["copies"] == []
    for flight in body["flights"]:
        assert {"flight", "path", "sha256", "controller", "airborne", "clean", "faults", "clock"} <= set(flight)
        assert flight["airborne"]
        assert flight["rates"]["imu"]["rate_hz"] > 0
    assert [i["sha256"] for i in body["manifest"]["inputs"]] == [f["sha256"] for f in body["flights"]]


def test_audit_is_the_same_for_any_number_of_processes(nanobench, recordings, tmp_path):
    """Made anew by two processes; what one of them made before may be known."""
    assert nanobench("audit", "--data", recordings, "--json", tmp_path / "2.json", "--out", tmp_path / "o", "--jobs",
                     2, "--quiet") == (0, "", "")
    assert nanobench("audit", "--data", recordings, "--json", tmp_path / "1.json", "--jobs", 1, "--quiet")[0] == 0
    one, two = (json.loads((tmp_path / f"{jobs}.json").read_text()) for jobs in (1, 2))
    assert one["flights"] == two["flights"]


def test_json_on_stdout_is_nothing_but_json(nanobench, recordings):
    code, out, _ = nanobench("audit", "--data", recordings, "--json", "-", "--jobs", 1)
    assert code == 0
    assert len(json.loads(out)["flights"]) == 3


def test_copies_are_found_by_content(nanobench, recordings, tmp_path):
    source = sorted(recordings.glob("*.csv"))[0]
    (tmp_path / "other_name.csv").write_bytes(source.read_bytes())
    code, out, _ = nanobench("audit", "--data", recordings, "--data", tmp_path, "--json", "-", "--jobs", 1)
    assert code == 0
    assert json.loads(out)["copies"] == [[source.stem, "other_name"]]


def test_convert_to_nanobench_and_back_is_the_same_recording(nanobench, recordings, tmp_path):
    assert nanobench("convert", "--data", recordings, "--to", "nanobench", "--out", tmp_path, "--jobs", 1)[0] == 0
    before, after = load_recordings([recordings]).flights, load_recordings([tmp_path]).flights
    assert [f.name for f in after] == [f.name for f in before]
    for a, b in zip(before, after, strict=True):
        assert b.provenance.synthetic
        assert b.epoch_s == a.epoch_s
        for name, stream in a.streams.items():
            np.testing.assert_allclose(b[name].values, stream.values, rtol=0, atol=2e-7)


def test_convert_never_overwrites_a_recording(nanobench, recordings, tmp_path):
    source = sorted(recordings.glob("*.csv"))[0]
    (tmp_path / source.name).write_bytes(source.read_bytes())
    code, _, err = nanobench("convert", "--data", tmp_path / source.name, "--out", tmp_path, "--quiet")
    assert code == 1
    assert "is the recording itself" in err
    assert (tmp_path / source.name).read_bytes() == source.read_bytes()


def test_convert_to_parquet_keeps_every_number_and_says_its_unit(nanobench, recordings, tmp_path):
    assert nanobench("convert", "--data", recordings, "--to", "parquet", "--out", tmp_path, "--jobs", 1)[0] == 0
    flight = load_recordings([recordings]).flights[0]
    table = pq.read_table(tmp_path / flight.name / "imu.parquet")
    assert table.column("time_s").to_numpy().tolist() == flight["imu"].time_s.tolist()
    assert table.column("acc_z").to_numpy().tolist() == flight["imu"]["acc_z"].tolist()
    assert table.schema.field("gyro_x").metadata[b"unit"] == b"rad/s"
    about = json.loads(table.schema.metadata[b"nanobench"])
    assert about["epoch_s"] == flight.epoch_s
    assert about["synthetic"] is True


def test_convert_to_tum_is_the_mocap_trajectory_in_absolute_time(nanobench, recordings, tmp_path):
    assert nanobench("convert", "--data", recordings, "--to", "tum", "--out", tmp_path, "--jobs", 1)[0] == 0
    flight = load_recordings([recordings]).flights[0]
    rows = np.loadtxt(tmp_path / f"{flight.name}.tum")
    np.testing.assert_allclose(rows[:, 0], flight.epoch_s + flight["mocap"].time_s, rtol=0, atol=1e-6)
    pose = flight["mocap"]["px", "py", "pz", "qx", "qy", "qz", "qw"]
    np.testing.assert_allclose(rows[:, 1:], pose, rtol=0, atol=1e-9)


def test_options_work_from_python(recordings, tmp_path):
    options = Options(data=(recordings,), out=tmp_path, quiet=True)
    audits, copies = options.audit(options.load())
    assert len(audits) == 3
    assert copies == []
    assert options.exit_code() == 0


@pytest.mark.slow
def test_a_cluster_gives_the_same_audit(nanobench, recordings, tmp_path):
    import dask
    import distributed

    nanobench("audit", "--data", recordings, "--json", tmp_path / "here.json", "--out", tmp_path / "h", "--jobs", 1)
    with dask.config.set({"temporary-directory": str(tmp_path)}), distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=":0", silence_logs=50,
            local_directory=str(tmp_path)) as cluster:
        code, out, err = nanobench("audit", "--data", recordings, "--json", tmp_path / "there.json", "--out",
                                   tmp_path / "t", "--scheduler", cluster.scheduler_address, "--quiet")
    assert (code, out, err) == (0, "", "")
    here, there = (json.loads((tmp_path / f"{name}.json").read_text()) for name in ("here", "there"))
    assert here["flights"] == there["flights"]
