"""Logs of cfclient, as its writer makes them: the blocks of a connection are one flight."""

from __future__ import annotations

import numpy as np
import pytest
from test_draft_axes import G, flown
from text_mutations import SEEDS, mutations, read_as_before

from nanobench_tools.sources import load_recordings

BOOT_MS = 12345


def block(names, values, boot_ms=BOOT_MS):
    t = flown()[0]
    rows = [",".join(["Timestamp", *names])]
    rows += [",".join([str((boot_ms + round(1e3 * t[k])) % (1 << 24)), *(f"{v:.9g}" for v in row)])
             for k, row in enumerate(values)]
    return ("\n".join(rows) + "\n").encode()


def blocks(**more):
    t, p, v, a, turn, w = flown()
    gyro = np.degrees(w)
    return {"State-20260305T05-47-11.csv": block(
        ["stateEstimate.x", "stateEstimate.y", "stateEstimate.z", "stateEstimate.vx", "stateEstimate.vy",
         "stateEstimate.vz"], np.hstack([p, v]), **more),
        "Imu-20260305T05-47-11.csv": block(
            ["gyro.x", "gyro.y", "gyro.z", "acc.x", "acc.y", "acc.z", "some.thing"],
            np.hstack([gyro, turn.inv().apply(a + G) / 9.81, t[:, None]]), **more),
        "Battery-20260305T05-47-11.csv": block(["pm.vbat"], np.full((len(t), 1), 3.9), **more)}


def write(folder, files):
    folder.mkdir(exist_ok=True)
    for name, data in files.items():
        (folder / name).write_bytes(data)
    return folder


@pytest.mark.parametrize("boot_ms", [BOOT_MS, (1 << 24) - 5000])
def test_the_blocks_of_a_connection_are_one_flight(tmp_path, boot_ms):
    loaded = load_recordings([write(tmp_path / "20260305T05-47-11", blocks(boot_ms=boot_ms))], cache=False)
    assert loaded.failed == []
    (flight,) = loaded.flights
    t, p, v, a, turn, w = flown()
    assert (flight.name, flight.provenance.source) == ("20260305T05-47-11", "cfclient")
    assert set(flight.streams) == {"estimator", "imu", "battery", "extra_Imu_20260305T05_47_11"}
    assert flight.epoch_s == pytest.approx(1e-3 * boot_ms)
    for name in ("estimator", "imu", "battery"):
        np.testing.assert_allclose(flight[name].time_s, t, atol=6e-4)
    np.testing.assert_allclose(flight["estimator"]["x", "y", "z", "vx", "vy", "vz"], np.hstack([p, v]), atol=1e-7)
    np.testing.assert_allclose(flight["imu"]["gyro_x", "gyro_y", "gyro_z"], w, atol=1e-7)
    np.testing.assert_allclose(flight["imu"]["acc_x", "acc_y", "acc_z"], turn.inv().apply(a + G), rtol=2e-3, atol=1e-6)


def test_one_block_alone(tmp_path):
    data = blocks()["Battery-20260305T05-47-11.csv"]
    (tmp_path / "a.csv").write_bytes(data)
    (flight,) = load_recordings([tmp_path / "a.csv"], cache=False).flights
    assert set(flight.streams) == {"battery"}


@pytest.mark.parametrize("data", [b"Timestamp,x,y\n1,2,3\n2,3,4\n", b"Timestamp,no.such\n1,2\n2,3\n",
                                  b"Timestamp,pm.vbat\n0.001,3.9\n0.0115,3.9\n", b"Timestamp,pm.vbat\n1e12,3.9\n"])
def test_others_tables_and_times_are_refused(tmp_path, data):
    (tmp_path / "a.csv").write_bytes(data)
    assert load_recordings([tmp_path / "a.csv"], cache=False).flights == []


@pytest.mark.parametrize("seeds", SEEDS)
def test_damage_gives_no_other_number(tmp_path, seeds):
    data = blocks()["Imu-20260305T05-47-11.csv"]
    (tmp_path / "a.csv").write_bytes(data)
    (before,) = load_recordings([tmp_path / "a.csv"], cache=False).flights
    found = [read_as_before(tmp_path, damaged, before) for damaged in mutations(data, seeds)]
    assert len(found) == 9 * seeds
    assert sum(flight is not None for flight in found) >= 5 * seeds
