"""Logs of the uSD deck before events: the example of the format byte by byte, a whole flight, and damage."""

from __future__ import annotations

import struct
import zlib

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_draft_axes import G, flown

from nanobench_tools.sources import load_recordings
from nanobench_tools.sources.usd_blocks import decompressed

EXAMPLE = bytes.fromhex(
    "03" "7469636b2849292c" "7374617465457374696d6174655a2e782868292c" "706d2e766261744d562848292c" "395ec55d"
    "02" "91250000e9ff080f" "fd4c0000e9ff020f" "4722161e")
NAMES = ("tick(I)", *(f"stateEstimateZ.{n}(h)" for n in ("x", "y", "z", "vx", "vy", "vz", "ax", "ay", "az")),
         "stateEstimateZ.quat(I)", *(f"stateEstimateZ.rate{n}(h)" for n in ("Roll", "Pitch", "Yaw")),
         "motor.thrust(f)", *(f"pwm.m{k}_pwm(I)" for k in (1, 2, 3, 4)), "pm.vbatMV(H)")
ROW = struct.Struct("<I9hI3hf4IH")


def compressed(q):
    """(4,) x, y, z, w -> 32 bits, as the firmware does."""
    largest = int(np.argmax(np.abs(q)))
    q = -q if q[largest] < 0.0 else q
    packed = largest
    for k in range(4):
        if k != largest:
            packed = (packed << 10) | ((q[k] < 0.0) << 9) | round(511.0 * np.sqrt(2.0) * abs(q[k]))
    return packed


def part(data):
    return data + struct.pack("<I", zlib.crc32(data) ^ 0xFFFFFFFF)


def log(pitch_sign=1.0, start_us=9927, rows_a_block=2):
    t, p, v, a, turn, w = flown()
    header = part(bytes([len(NAMES)]) + "".join(f"{n}," for n in NAMES).encode())
    mm, mrad = np.round(1e3 * np.hstack([p, v, a + G])).astype(int), np.round(1e3 * w).astype(int)
    rows = [ROW.pack((start_us + round(1e6 * t[k])) % (1 << 32), *mm[k], compressed(q), mrad[k, 0],
                     round(pitch_sign * mrad[k, 1]), mrad[k, 2], 0.3, *[40000] * 4, 3900)
            for k, q in enumerate(turn.as_quat())]
    blocks = [part(bytes([len(c)]) + b"".join(c)) for c in (rows[k:k + rows_a_block]
                                                           for k in range(0, len(rows), rows_a_block))]
    return header, blocks


def read(tmp_path, data):
    (tmp_path / "cf50_01").write_bytes(data)
    return load_recordings([tmp_path / "cf50_01"], cache=False)


def test_the_example_of_the_format(tmp_path):
    (flight,) = read(tmp_path, EXAMPLE).flights
    np.testing.assert_allclose(flight["estimator"].time_s, [0.0, 0.010092])
    np.testing.assert_allclose(flight["estimator"]["x"], -0.023)
    np.testing.assert_allclose(flight["battery"]["vbat"], [3.848, 3.842])
    np.testing.assert_allclose(decompressed(np.array([0xE0380800], dtype=np.uint32))[0],
                               [-0.00415, -0.00277, 0.0, 0.99999], atol=1e-5)


@pytest.mark.parametrize("pitch_sign", [1.0, -1.0])
def test_a_flight_is_in_si_and_the_attitude_shows_the_sign_of_its_rate(tmp_path, pitch_sign):
    header, blocks = log(pitch_sign)
    (flight,) = read(tmp_path, header + b"".join(blocks)).flights
    _, p, v, a, turn, w = flown()
    np.testing.assert_allclose(flight["estimator"]["x", "y", "z"], p, atol=6e-4)
    np.testing.assert_allclose(flight["estimator"]["vx", "vy", "vz"], v, atol=6e-4)
    np.testing.assert_allclose(flight["estimator_acc"]["ax", "ay", "az"], a, atol=6e-4)
    q = Rotation.from_quat(flight["attitude_qw"]["qx", "qy", "qz", "qw"])
    assert (q.inv() * turn).magnitude().max() < 4e-3
    np.testing.assert_allclose(flight["imu"]["gyro_x", "gyro_y", "gyro_z"], w, atol=6e-4)
    np.testing.assert_allclose(flight["motor"].values, 40000.0 / 65535.0)
    assert flight.provenance.findings == ()


def test_ticks_wrap(tmp_path):
    header, blocks = log(start_us=(1 << 32) - 2_000_000)
    (flight,) = read(tmp_path, header + b"".join(blocks)).flights
    np.testing.assert_allclose(flight["imu"].time_s, flown()[0], atol=1e-6)


def test_bad_blocks_are_left_out_and_the_rest_is_read(tmp_path):
    header, blocks = log()
    damaged = [*blocks]
    damaged[20] = damaged[20][:9] + b"\xff" + damaged[20][10:]
    damaged[40] = b"\xc8" + damaged[40][1:]
    (flight,) = read(tmp_path, header + b"".join(damaged)).flights
    assert len(flight["imu"]) == 2 * (len(blocks) - 2)
    assert [f.kind for f in flight.provenance.findings] == ["checksum"]
    assert "2 blocks" in flight.provenance.findings[0].evidence
    (flight,) = read(tmp_path, header + b"".join(blocks)[:-7]).flights
    assert [f.kind for f in flight.provenance.findings] == ["truncated"]
    assert read(tmp_path, header).flights == []
