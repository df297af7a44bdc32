"""ArduPilot logs, written message by message from a flight that is known."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from test_draft_axes import G, flown

from nanobench_tools.sources import load_recordings
from nanobench_tools.sources.dataflash_messages import FMT

STRUCT = {"Q": "Q", "B": "B", "f": "f", "c": "h", "H": "H", "N": "16s", "I": "I", "h": "h", "i": "i"}
LAYOUTS = {
    "FMT": (0x80, "BBnNZ", "Type,Length,Name,Format,Columns"),
    "PARM": (1, "QNf", "TimeUS,Name,Value"),
    "IMU": (2, "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"),
    "ATT": (3, "Qccc", "TimeUS,Roll,Pitch,Yaw"),
    "XKF1": (4, "QBffffff", "TimeUS,C,VN,VE,VD,PN,PE,PD"),
    "RCOU": (5, "QHHHHHHHH", "TimeUS,C1,C2,C3,C4,C5,C6,C7,C8"),
    "BAT": (6, "QBf", "TimeUS,Inst,Volt"),
    "ESC": (7, "QBi", "TimeUS,Instance,RPM"),
    "GPS": (8, "QBIH", "TimeUS,Status,GMS,GWk"),
    "VISP": (9, "Qffffff", "TimeUS,PX,PY,PZ,R,P,Y"),
}
START_S = 40.0
PARAMETERS = {"FRAME_CLASS": 1, "FRAME_TYPE": 1, "MOT_PWM_MIN": 1000, "MOT_PWM_MAX": 2000, "SERVO5_FUNCTION": 33,
              "SERVO6_FUNCTION": 34, "SERVO7_FUNCTION": 35, "SERVO8_FUNCTION": 36}
OURS = ((33, 1300), (36, 1600), (34, 1400), (35, 1500))
"""Function and PWM of front right, back right, back left, front left."""
WEEK, MS = 2200, 3000


def define(name):
    number, letters, columns = LAYOUTS[name]
    length = 89 if name == "FMT" else 3 + struct.calcsize("<" + "".join(STRUCT[c] for c in letters))
    return b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", number, length, name.encode(), letters.encode(),
                                         columns.encode())


def message(name, *values):
    number, letters, _ = LAYOUTS[name]
    return b"\xa3\x95" + bytes([number]) + struct.pack("<" + "".join(STRUCT[c] for c in letters), *values)


def log(parameters=PARAMETERS, poses=True):
    """The flight of ``flown``, in NED and FRD."""
    t, p, v, a, turn, w = flown()
    ned = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])
    frd = np.diag([1.0, -1.0, -1.0])
    force, gyro = turn.inv().apply(a + G) @ frd, w @ frd
    place, speed = p @ ned.T, v @ ned.T
    matrix = ned @ turn.as_matrix() @ frd
    angles = type(turn).from_matrix(matrix).as_euler("ZYX", degrees=True)[:, ::-1]
    parts = [define(name) for name in LAYOUTS]
    parts += [message("PARM", 0, name.encode(), value) for name, value in parameters.items()]
    by_function = dict(OURS)
    pwm = [0] * 4 + [by_function[33], by_function[34], by_function[35], by_function[36]]
    for k in range(len(t)):
        us = round(1e6 * (START_S + t[k]))
        parts += [message("IMU", us, i, *gyro[k], *force[k]) for i in (0, 1)]
        parts += [message("ATT", us, *(round(100.0 * x) for x in angles[k])),
                  message("XKF1", us, 0, *speed[k], *place[k]), message("RCOU", us, *pwm)]
        parts += [message("VISP", us, *place[k], *angles[k])] * poses
        parts += [message("ESC", us + 100 * i, i, 6000 + 100 * i) for i in (4, 5, 6, 7)]
        if k % 10 == 0:
            parts += [message("BAT", us, 0, 15.5), message("GPS", us, 3, MS + round(1e3 * t[k]), WEEK)]
    return parts


def read(tmp_path, data):
    (tmp_path / "00000012.BIN").write_bytes(data)
    return load_recordings([tmp_path / "00000012.BIN"], cache=False)


def test_every_stream_is_in_our_axes_and_units(tmp_path):
    (flight,) = read(tmp_path, b"".join(log())).flights
    t, p, v, a, turn, w = flown()
    assert (flight.provenance.source, flight.provenance.findings) == ("ardupilot", ())
    assert set(flight.streams) == {"imu", "attitude", "estimator", "mocap", "motor", "rpm", "battery"}
    assert flight.epoch_s == pytest.approx(315964800 - 18 + WEEK * 604800 + 1e-3 * MS, abs=2e-3)
    np.testing.assert_allclose(flight["imu"].time_s, t, atol=2e-6)
    np.testing.assert_allclose(flight["imu"]["gyro_x", "gyro_y", "gyro_z"], w, atol=1e-6)
    np.testing.assert_allclose(flight["imu"]["acc_x", "acc_y", "acc_z"], turn.inv().apply(a + G), atol=1e-5)
    np.testing.assert_allclose(flight["estimator"]["x", "y", "z", "vx", "vy", "vz"], np.hstack([p, v]), atol=1e-5)
    np.testing.assert_allclose(flight["mocap"]["px", "py", "pz"], p, atol=1e-5)
    wrong = flight["attitude"]["roll", "pitch", "yaw"] - turn.as_euler("ZYX")[:, ::-1]
    assert np.abs((wrong + np.pi) % (2.0 * np.pi) - np.pi).max() < 2e-4
    seen = type(turn).from_quat(flight["mocap"]["qx", "qy", "qz", "qw"])
    assert (seen.inv() * turn).magnitude().max() < 1e-5
    np.testing.assert_allclose(flight["motor"].values[0], [(us - 1000) / 1000 for _, us in OURS])
    np.testing.assert_allclose(flight["rpm"].values[0],
                               np.array([6400, 6700, 6500, 6600]) * 2.0 * np.pi / 60.0)
    np.testing.assert_allclose(flight["battery"]["vbat"], 15.5)


@pytest.mark.parametrize(("changed", "words"), [
    ({"FRAME_TYPE": 0}, "no parameters of a quadrotor X"), ({"SERVO5_FUNCTION": 0}, "no parameters of a quadrotor X"),
    ({"MOT_PWM_MAX": 0}, "no MOT_PWM_MIN")])
def test_motors_without_their_parameters_are_left_out(tmp_path, changed, words):
    (flight,) = read(tmp_path, b"".join(log({**PARAMETERS, **changed}))).flights
    assert "motor" not in flight
    assert any(words in note for note in flight.provenance.notes)


def damaged(seeds):
    """(kind, data, whether all rows that are read have to be as they were)."""
    parts = log()
    whole = b"".join(parts)
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        at = int(rng.integers(len(whole) // 10, len(whole)))
        yield "truncated", whole[:at], True
        some = set(rng.choice(np.arange(40, len(parts)), 5, replace=False).tolist())
        yield "lost messages", b"".join(part for k, part in enumerate(parts) if k not in some), True
        yield "twice", b"".join(part * (1 + (k in some)) for k, part in enumerate(parts)), True
        yield "cut messages", b"".join(part[:len(part) // 2] if k in some else part
                                       for k, part in enumerate(parts)), True
        noise = rng.integers(0, 256, 40, dtype=np.uint8).tobytes()
        yield "noise between", b"".join(part + (noise if k in some else b"") for k, part in enumerate(parts)), True
        flipped = bytearray(whole)
        for place in rng.integers(0, len(whole), 20):
            flipped[place] ^= int(rng.integers(1, 256))
        yield "flipped bytes", bytes(flipped), False
        defined = list(parts)
        defined[int(rng.integers(2, list(LAYOUTS).index("GPS")))] = b""
        yield "no definition", b"".join(defined), True


@pytest.mark.parametrize("seeds", [6, pytest.param(15, marks=pytest.mark.slow)])
def test_damage_gives_no_other_number(tmp_path, seeds):
    (before,) = read(tmp_path, b"".join(log())).flights
    count = 0
    for kind, data, same in damaged(seeds):
        count += 1
        loaded = read(tmp_path, data)
        if not loaded.flights:
            assert "failed," not in loaded.failed[0]["error"], kind
            continue
        (flight,) = loaded.flights
        assert kind in ("lost messages", "twice", "flipped bytes") or {
            f.kind for f in flight.provenance.findings} & {"truncated", "checksum"}, kind
        if not same:
            continue
        shift = flight.epoch_s - before.epoch_s
        for name, stream in flight.streams.items():
            old = before[name]
            at = np.clip(np.searchsorted(old.time_s, stream.time_s + shift - 2e-3), 0, len(old) - 1)
            near = np.abs(old.time_s[at] - stream.time_s - shift) < 2e-3
            assert (~near).sum() <= 5, kind
            differs = np.abs(stream.values[near] - old.values[at[near]]).max(axis=1) > 1e-9
            assert differs.sum() <= (5 if name == "rpm" else 0), f"{kind}: {name}"
    assert count == 7 * seeds


def test_definitions_that_cannot_be_are_ignored(tmp_path):
    bad = b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", FMT, 3, b"FMT", b"Q", b"A")
    bad += b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", 77, 0, b"X", b"Qz", b"A,B")
    loaded = read(tmp_path, bad + b"\xa3\x95\x4d" * 50)
    assert loaded.flights == []
    assert "an ArduPilot log without" in loaded.failed[0]["error"]
