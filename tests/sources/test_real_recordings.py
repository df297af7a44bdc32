"""Every reader on the real recordings, against what is known about them from elsewhere."""

from __future__ import annotations

import hashlib
import json
import lzma
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
import yaml
from fifteen import FIFTEEN, STOPPED

from nanobench_tools import Span, so3
from nanobench_tools.sources import find_recordings, load_recordings, write_nanobench
from nanobench_tools.sources.describe import describe
from nanobench_tools.sources.interpolation import count_packets

pytestmark = pytest.mark.real


@pytest.fixture(scope="module")
def everything(real_data):
    return load_recordings([real_data / "nanobench"], jobs=2)


@pytest.fixture(scope="module", params=["15", pytest.param("all", marks=pytest.mark.slow)])
def flights(request, real_data):
    """Of 15 recordings, or of all with their slices."""
    if request.param == "all":
        return request.getfixturevalue("everything").flights
    folder = real_data / "nanobench" / "datasets" / "dataset"
    return load_recordings([folder / f"{name}.csv.xz" for name in FIFTEEN]).flights


def own_sheet(flight):
    path = Path(flight.provenance.path.replace(".csv.xz", "_metadata.yaml"))
    return yaml.safe_load(path.read_text()) if path.exists() else None


@pytest.mark.slow
def test_all_files_are_read_and_nothing_else_is_claimed(everything, real_data):
    files = list((real_data / "nanobench").rglob("*.csv.xz"))
    assert len(everything.flights) == len(files) >= 100
    assert everything.failed == []
    assert len({f.name for f in everything.flights}) == len(files)


def test_every_flight_has_52_columns_and_no_bad_cell(flights):
    for flight in flights:
        assert sum(len(s.columns) for s in flight.streams.values()) == 51
        assert {f.kind for f in flight.provenance.findings} <= {"truncated"}
        assert all(np.isfinite(s.values).all() for s in flight.streams.values())


def test_sheet_found_by_time_is_the_one_beside_the_file(flights):
    with_sheet = 0
    for flight in flights:
        sheet = own_sheet(flight)
        if sheet is None:
            continue
        with_sheet += 1
        assert flight.metadata["trajectory_id"] == sheet["trajectory_id"]
        assert flight.metadata["recording_start_utc"] == sheet["recording_start_utc"]
        rows = sheet["row_counts"]["vicon"]
        assert len(flight["mocap"]) == rows or "truncated" in {f.kind for f in flight.provenance.findings}
        if len(flight["mocap"]) == rows:
            counts = {k: s.samples for k, s in flight.streams.items()}
            names = {"mocap": "vicon", "pid": "pid_output", "battery": "power"}
            assert counts == {k: sheet["row_counts"][names.get(k, k)] for k in counts}
    assert with_sheet >= (70 if len(flights) > 15 else 15)


@pytest.mark.slow
def test_only_one_recording_was_cut(everything):
    cut = [f for f in everything.flights if f.provenance.findings]
    assert [(len(f["mocap"]), f.provenance.findings[0].kind) for f in cut] == [(2868, "truncated")]


def test_streams_that_stopped_early_keep_their_rate(flights):
    """1196 IMU packets in the 12.5 s before the log of one flight stopped are 96 a second, not 28."""
    stopped = [
        f for f in flights if f.metadata.get("row_counts", {}).get("imu") == 1196 and len(f["imu"]) == 4228
    ]
    assert stopped
    assert all(f["imu"].rate_hz == pytest.approx(96.0, abs=1.0) for f in stopped)


def test_specific_force_at_rest_is_gravity(flights):
    for flight in flights:
        still = Span(0.2, 1.5)
        if np.linalg.norm(np.ptp(flight["mocap"].during(still)["px", "py", "pz"], axis=0)) > 0.02:
            continue
        norm = np.linalg.norm(flight["imu"].during(still)["acc_x", "acc_y", "acc_z"], axis=1)
        assert np.median(norm) == pytest.approx(9.81, rel=0.01), flight.name


def test_pitch_has_the_sign_of_the_quaternion(flights):
    for flight in flights:
        end = count_packets(flight["attitude"].time_s, flight["attitude"].values).last_s - 0.1
        keep = flight["attitude"].time_s < min(
            end, count_packets(flight["attitude_qw"].time_s, flight["attitude_qw"].values).last_s - 0.1
        )
        q = flight["attitude_qw"]["qx", "qy", "qz", "qw"][keep]
        roll, pitch, _ = _euler(q)
        assert np.median(np.abs(roll - flight["attitude"]["roll"][keep])) < np.radians(0.3), flight.name
        assert np.median(np.abs(pitch - flight["attitude"]["pitch"][keep])) < np.radians(0.3), flight.name
        mocap = _euler(flight["mocap"]["qx", "qy", "qz", "qw"])
        np.testing.assert_allclose(mocap[1], flight["mocap"]["pitch"], atol=2e-6)


def _euler(q):
    x, y, z, w = (q / np.linalg.norm(q, axis=1, keepdims=True)).T
    return (
        np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
        np.arcsin(np.clip(2 * (w * y - z * x), -1, 1)),
        np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
    )


def test_the_packages_own_euler_angles_agree(flights):
    q = flights[0]["mocap"]["qx", "qy", "qz", "qw"]
    np.testing.assert_allclose(so3.euler_zyx(q), np.stack(_euler(q), axis=-1), atol=1e-9)


def test_estimated_counts_agree_with_the_sheets(flights):
    """The chord test, which slices and cut files rest on, within 15 % on every stream that moves; median within 3 %."""
    error: dict[str, list[float]] = {}
    for flight in flights:
        if own_sheet(flight) is None or len(flight["mocap"]) != flight.metadata["row_counts"]["vicon"]:
            continue
        if len(flights) == len(FIFTEEN) and flight.name in STOPPED:  # few of all, but most of these
            continue
        for name in ("imu", "motor", "estimator", "estimator_acc", "attitude", "setpoint", "battery"):
            stream = flight[name]
            error.setdefault(name, []).append(count_packets(stream.time_s, stream.values).count / stream.samples - 1.0)
    for name, errors in error.items():
        assert abs(np.median(errors)) < 0.03, name
        assert np.quantile(np.abs(errors), 0.9) < (0.15 if name != "battery" else 0.3), name


def test_family_from_content_is_never_wrong(flights):
    rng = np.random.default_rng(0)
    right = total = 0
    for number, flight in enumerate(flights):
        family = flight.metadata["family"]
        if "trajectory_type" not in flight.metadata:
            continue
        found = describe(flight)
        total += 1
        right += found["family"] == family
        assert found["family"] in (family, None), flight.name
        if flight.metadata["speed"] is not None:
            assert found["speed"] in (flight.metadata["speed"], None), flight.name
        if number % 3:
            continue
        end = flight.span.end_s
        start = rng.uniform(0.0, 0.5 * end)
        piece = describe(flight.during(Span(start, rng.uniform(min(start + 8.0, end), end))))
        assert piece["family"] in (family, None), flight.name
    assert total - right <= max(1, 0.05 * total)


@pytest.mark.parametrize(("part", "least"), [("*_fast_*", 7), pytest.param("*", 27, marks=pytest.mark.slow)])
def test_slices_get_their_family_without_any_sheet(real_data, part, least):
    folder = real_data / "nanobench" / "benchmarks" / "task3_stateEst"
    loaded = load_recordings(sorted(folder.rglob(f"{part}.csv.xz")))
    assert {f.metadata["family"] for f in loaded.flights} == {"trefoil"}
    for flight in loaded.flights:
        speed = next(s for s in ("slow", "medium", "fast") if s in flight.name)
        assert flight.metadata["speed"] in (speed, None), flight.name
    assert sum(f.metadata["speed"] is not None for f in loaded.flights) >= least


def test_round_trip_of_a_real_recording(flights, tmp_path):
    flight = flights[-1]
    write_nanobench(flight, tmp_path / "a.csv")
    assert (tmp_path / "a.csv").read_bytes() == lzma.decompress(Path(flight.provenance.path).read_bytes())
    after = load_recordings([tmp_path], cache=False).flights[0]
    for name, stream in flight.streams.items():
        np.testing.assert_array_equal(after[name].values, stream.values)
        assert after[name].samples == stream.samples
    assert after.metadata["row_counts"] == flight.metadata["row_counts"]


@pytest.mark.parametrize(("folder", "least"), [("crazyflie_usd", 25), ("crazypad", 56)])
def test_usd_logs(real_data, folder, least):
    logs = [path for path in (real_data / folder).rglob("*") if path.is_file() and not path.suffix]
    assert len(logs) >= least
    loaded = load_recordings([real_data / folder])
    assert len(loaded.flights) == len(logs)
    assert loaded.failed == []
    for flight in loaded.flights:
        assert flight.provenance.source == "usd"
        assert flight.provenance.findings == ()
        data = Path(flight.provenance.path).read_bytes()
        assert zlib.crc32(data[:-4]) == struct.unpack("<I", data[-4:])[0]
        records = sum(flight.metadata["records"].values())
        assert records > 500
        values = flight["motor"].values
        assert 0.0 <= values.min() <= values.max() <= 1.0
        assert 2.5 < flight["battery"]["vbat"].min() <= flight["battery"]["vbat"].max() < 4.4
        assert np.all(np.diff(flight["motor"].time_s) > 0.0)


def test_logs_of_the_lee_controller(real_data):
    """The units of its variables, from the flights: what the set-point asks is flown, attitude turns as the gyro says,
    thrust forward speeds up forward, and standard motors hover a little below the weight that was told."""
    loaded = load_recordings([real_data / "crazyswarm_lee"])
    assert (len(loaded.flights), loaded.failed) == (69, [])
    told = json.loads((real_data / "crazyswarm_lee" / "labels.json").read_text())
    share, follows, turns, leans = [], [], [], []
    for flight in loaded.flights:
        t, there = flight["estimator"].time_s, flight["estimator"]["x", "y", "z"]
        asked, attitude, gyro = flight["setpoint"]["x"], flight["attitude"], flight["imu"]
        hardware, mass_kg = told[flight.name]
        assert flight["command"].unit == ("N",)
        if hardware == "standard":
            share.append(np.median(flight["command"]["thrust"]) / (9.81 * mass_kg))
        if np.ptp(asked) > 0.5:
            follows.append(np.polyfit(asked, there[:, 0], 1)[0])
        rate = (attitude["pitch"][8:] - attitude["pitch"][:-8]) / (t[8:] - t[:-8])
        turns.append(np.corrcoef(rate, gyro["gyro_y"][4:-4])[0, 1])
        pull = (flight["estimator"]["vx"][8:] - flight["estimator"]["vx"][:-8]) / (t[8:] - t[:-8])
        leans.append(np.corrcoef(pull, attitude["pitch"][4:-4])[0, 1])
    assert 0.9 < np.median(share) < 1.0
    assert np.median(follows) == pytest.approx(1.0, abs=0.1)
    assert np.median(turns) > 0.95
    assert np.median(leans) > 0.9


def test_usd_streams_agree_with_each_other(real_data):
    """Measured RPM, mocap poses and the estimate of 500 Hz logs."""
    for flight in load_recordings([real_data / "crazyflie_usd"]).flights:
        at = flight["mocap"].time_s[5:-5]
        gap = flight["mocap"]["px", "py", "pz"][5:-5] - flight["estimator"].interpolate(("x", "y", "z"), at)
        assert np.median(np.linalg.norm(gap, axis=1)) < 0.05
        norm = np.linalg.norm(flight["attitude_qw"]["qx", "qy", "qz", "qw"], axis=1)
        np.testing.assert_allclose(norm, 1.0, atol=1e-3)
        assert 400.0 < flight["imu"].rate_hz < 520.0
        assert flight["estimator"].samples < 0.7 * len(flight["estimator"])  # the estimate changes every second row
        assert 1000.0 < np.median(flight["rpm"].values) < 3000.0
        assert np.median(flight["imu"]["acc_z"]) == pytest.approx(9.81, rel=0.1)  # more in turns


def test_motor_commands_before_and_after_the_compensation(real_data):
    """With the firmware's older formula for the battery the one gives the other."""
    for flight in load_recordings([real_data / "crazypad" / "E8" / "normal"]).flights:
        thrust = 60.0 * flight["motor_request"].values * 65535.0 / 65536.0
        volts = -0.0006239 * thrust**2 + 0.088 * thrust
        spins = flight["motor_request"].values > 0.2
        ratio = (flight["motor"].values * flight["battery"].values / np.where(spins, volts, 1.0))[spins]
        assert np.median(ratio) == pytest.approx(1.0, abs=0.01)


def test_thrust_stands(real_data):
    loaded = load_recordings([real_data / "stand"])
    assert len(loaded.flights) == 6
    assert loaded.failed == []
    for flight in loaded.flights:
        assert flight.provenance.source == "stand"
        assert {f.kind for f in flight.provenance.findings} <= {"missing_column"}
        assert 2.5 < np.median(flight["battery"]["vbat"]) < 4.4
        if "stand" in flight:
            assert 0.05 < np.median(flight["stand"]["thrust"][flight["motor"]["m1"] > 0.3]) < 2.0
    assert sum("stand" in flight for flight in loaded.flights) == 3  # one stand recorded a load cell that was not there


def test_sources_never_take_each_others_files(real_data):
    recordings, failed = find_recordings([real_data / f for f in ("nanobench", "crazyflie_usd", "crazypad", "stand")])
    assert failed == []
    right = {"nanobench": "nanobench", "crazyflie_usd": "usd", "crazypad": "usd", "stand": "stand"}
    assert all(r.source == right[r.path.relative_to(real_data).parts[0]] for r in recordings)


def test_mutated_real_recording(real_data, tmp_path):
    """Noise over a stretch of a real file: the rows outside it keep every digit."""
    path = min((real_data / "nanobench").rglob("*.csv.xz"), key=lambda p: p.stat().st_size)
    whole = lzma.decompress(path.read_bytes())
    lines = whole.split(b"\n")
    original = load_recordings([path], cache=False).flights[0]
    digests = set()
    for seed in range(25):
        rng = np.random.default_rng(seed)
        start = int(rng.integers(len(lines[0]) + 1, len(whole) - 500))
        noise = rng.choice(np.frombuffer(b"xyz\x00\xff\"';#@ \t,", np.uint8), int(rng.integers(1, 500))).tobytes()
        data = whole[:start] + noise + whole[start + len(noise) :]
        digests.add(hashlib.sha256(data).digest())
        (tmp_path / "a").write_bytes(data)
        flight = load_recordings([tmp_path / "a"], cache=False).flights[0]
        assert "bad_cell" in {f.kind for f in flight.provenance.findings}
        first, last = whole[:start].count(b"\n") - 1, whole[: start + len(noise)].count(b"\n") - 1
        for name, stream in flight.streams.items():
            for rows in (slice(0, max(first, 0)), slice(last + 1 - len(original[name]), None)):
                if rows.start == 0 and rows.stop == 0:
                    continue
                np.testing.assert_array_equal(stream.values[rows], original[name].values[rows])
    assert len(digests) == 25
