"""Blackbox logs of Betaflight and INAV as decoded CSV: units are found, or the signal is left out."""

from __future__ import annotations

import numpy as np
import pytest
from test_draft_axes import G, flown
from text_mutations import SEEDS, mutations, read_as_before

from nanobench_tools.sources import load_recordings

SHARE = np.array([0.30, 0.31, 0.32, 0.33])
"""Of motors back right, front right, back left, front left."""


def log(gyro="", acc="", setpoint=True, acc_scale=2048.0 / 9.81, gyro_scale=1.0, motors=None, separator=", "):
    t, _, _, a, turn, w = flown()
    degrees = np.degrees(w) * 20.0
    force = turn.inv().apply(a + G)
    columns = {"loopIteration": 8 * np.arange(len(t)), "time (us)": np.round(5.5e7 + 1e6 * t)}
    if setpoint:
        columns |= {f"setpoint[{k}]": np.roll(degrees[:, k], -1) for k in range(3)}
    columns |= {"vbatLatest (V)": np.full(len(t), 14.2)}
    columns |= {f"gyroADC[{k}]{gyro}": gyro_scale * degrees[:, k] for k in range(3)}
    columns |= {f"accSmooth[{k}]{acc}": acc_scale * force[:, k] for k in range(3)}
    found = 48.0 + 1999.0 * SHARE if motors is None else motors
    columns |= {f"motor[{k}]": np.full(len(t), found[k]) for k in range(len(found))}
    rows = [separator.join([*columns, "flightModeFlags (flags)"])]
    rows += [separator.join([*(f"{v:.9g}" for v in row), "ANGLE_MODE|X"])
             for row in zip(*columns.values(), strict=True)]
    return ("\n".join(rows) + "\n").encode()


def read(tmp_path, data):
    (tmp_path / "a.csv").write_bytes(data)
    return load_recordings([tmp_path / "a.csv"], cache=False)


@pytest.mark.parametrize("wrote", [
    {}, {"separator": ","}, {"gyro": " (deg/s)", "setpoint": False}, {"gyro_scale": 16.4}, {"acc_scale": 512.0 / 9.81},
    {"gyro": " (rad/s)", "gyro_scale": np.pi / 180.0}, {"acc": " (m/s/s)", "acc_scale": 1.0},
    {"acc": " (g)", "acc_scale": 1.0 / 9.81}, {"motors": 1000.0 + 1000.0 * np.array([0.1, 0.31, 0.32, 0.33])}])
def test_units_are_found(tmp_path, wrote):
    (flight,) = read(tmp_path, log(**wrote)).flights
    t, _, _, a, turn, w = flown()
    assert (flight.provenance.source, flight.epoch_s) == ("blackbox", pytest.approx(55.0))
    assert set(flight.streams) == {"imu", "motor", "battery"}
    np.testing.assert_allclose(flight["imu"].time_s, t, atol=2e-6)
    np.testing.assert_allclose(flight["imu"]["gyro_x", "gyro_y", "gyro_z"], 20.0 * w, atol=1e-6)
    np.testing.assert_allclose(flight["imu"]["acc_x", "acc_y", "acc_z"], turn.inv().apply(a + G), rtol=4e-4, atol=1e-6)
    expected = SHARE if "motors" not in wrote else np.array([0.1, *SHARE[1:]])
    np.testing.assert_allclose(flight["motor"].values[0], expected[[1, 0, 2, 3]], atol=1e-6)
    np.testing.assert_allclose(flight["battery"]["vbat"], 14.2)


@pytest.mark.parametrize(("wrote", "lacks", "words"), [
    ({"setpoint": False}, "gyro_x", "gyro left out"), ({"gyro_scale": 4.0}, "gyro_x", "gyro left out"),
    ({"gyro_scale": -1.0}, "gyro_x", "gyro left out"), ({"acc_scale": 300.0}, "acc_x", "accelerometer left out"),
    ({"motors": np.full(4, 0.3)}, "m1", "motors left out"), ({"motors": np.full(6, 500.0)}, "m1", "no quadrotor")])
def test_what_no_unit_is_shown_of_is_left_out(tmp_path, wrote, lacks, words):
    (flight,) = read(tmp_path, log(**wrote)).flights
    assert not any(lacks in stream for stream in flight.streams.values())
    assert any(words in note for note in flight.provenance.notes)


def test_the_log_itself_names_the_program_that_converts_it(tmp_path):
    (tmp_path / "LOG00007.BFL").write_bytes(
        b"H Product:Blackbox flight data recorder by Nicholas Sherlock\nH Data version:2\n" + bytes(range(256)) * 20)
    (failure,) = load_recordings([tmp_path / "LOG00007.BFL"], cache=False).failed
    assert "convert it with `blackbox_decode" in failure["error"]


@pytest.mark.parametrize("seeds", SEEDS)
def test_damage_gives_no_other_number(tmp_path, seeds):
    data = log(separator=",", gyro=" (deg/s)", acc=" (m/s2)", acc_scale=1.0)
    (before,) = read(tmp_path, data).flights
    found = [read_as_before(tmp_path, damaged, before) for damaged in mutations(data, seeds)]
    assert len(found) == 9 * seeds
    assert sum(flight is not None for flight in found) >= 5 * seeds
