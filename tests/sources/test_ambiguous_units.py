"""Numbers that fit two units, or none: the draft asks."""

from __future__ import annotations

import numpy as np
import pytest
from test_draft_axes import G, flown

from nanobench_tools.signals.column_draft import draft_columns

ROTORS = ("rotor1", "rotor2", "rotor3", "rotor4")


def drafted(folder, names, values):
    t, p, *_ = flown()
    path = folder / "flight.csv"
    np.savetxt(path, np.column_stack([t, p, values]), delimiter=",", header=",".join(["t", "px", "py", "pz", *names]),
               comments="", fmt="%.10g")
    return draft_columns(path)


@pytest.mark.parametrize(("speed", "unit"), [(2000.0, ""), (320.0, ""), (20000.0, "rpm"), (20.0, "")])
def test_rotor_speeds_without_a_unit(tmp_path, speed, unit):
    """2000 may be rad/s or rpm, 320 rad/s or revolutions per second; 20 000 is rpm. Slow rpm may be eRPM/100."""
    turning = speed * (1.0 + 0.01 * np.sin(np.outer(flown()[0], np.arange(1.0, 5.0))))
    draft = drafted(tmp_path, ROTORS, turning)
    assert draft.mapped.get(("rpm", "m1")) == (("rotor1", unit) if unit else None)
    assert bool(draft.questions) != bool(unit)
    named = drafted(tmp_path, ("rpm1", "rpm2", "rpm3", "rpm4"), turning)
    assert named.mapped.get(("rpm", "m1")) == (("rpm1", "rpm") if unit else None)


@pytest.mark.parametrize("names", [("acc_x", "acc_y", "acc_z")])
@pytest.mark.parametrize(("per_m_s2", "unit"), [
    (1.0, "m/s^2"), (1.0 / 9.81, "g"), (1e3, "mm/s^2"), (16384.0 / 9.81, ""), (0.5, "")],
    ids=["SI", "g", "mm/s^2", "counts of 1/16384 g", "half"])
def test_a_specific_force_has_the_size_of_gravity(tmp_path, names, per_m_s2, unit):
    *_, a, turn, _ = flown()
    draft = drafted(tmp_path, names, per_m_s2 * turn.inv().apply(a + G))
    assert draft.mapped.get(("imu", "acc_z")) == (("acc_z", unit) if unit else None)


@pytest.mark.parametrize("per_rad", [1e3, 100.0 * np.degrees(1.0)], ids=["mrad", "0.01 deg"])
def test_a_pitch_beyond_a_right_angle_is_in_another_unit(tmp_path, per_rad):
    angles = 3.0 * flown()[4].as_euler("ZYX")[:, ::-1]
    draft = drafted(tmp_path, ("roll", "pitch", "yaw"), per_rad * angles)
    assert ("attitude", "pitch") not in draft.mapped
    assert "exceeds a right angle" in draft.questions[0]
    for degrees in (np.degrees(angles), np.degrees(angles) % 360.0):
        assert drafted(tmp_path, ("roll", "pitch", "yaw"), degrees).mapped["attitude", "pitch"] == ("pitch", "deg")


@pytest.mark.parametrize(("low", "high", "unit"), [(10000.0, 16000.0, ""), (10000.0, 40000.0, "pwm16"),
                                                   (1000.0, 1600.0, "pulse_us")])
def test_commands_of_10000_to_20000_may_be_pulses(tmp_path, low, high, unit):
    shares = 0.5 + 0.5 * np.sin(np.outer(flown()[0], np.arange(1.0, 5.0)))
    draft = drafted(tmp_path, ("m1", "m2", "m3", "m4"), np.round(low + (high - low) * shares))
    assert draft.mapped.get(("motor", "m1")) == (("m1", unit) if unit else None)


def test_counts_of_an_accelerometer_are_named(tmp_path):
    *_, a, turn, _ = flown()
    draft = drafted(tmp_path, ("acc_x", "acc_y", "acc_z"), np.round(2048.0 / 9.81 * turn.inv().apply(a + G)))
    assert ("imu", "acc_z") not in draft.mapped
    assert "2048 of them 1 g" in draft.questions[0]


@pytest.mark.parametrize("factor", [np.degrees(1.0), np.radians(1.0)], ids=["deg as rad", "rad as deg"])
def test_a_gyro_in_another_unit_than_stated_is_asked_about_where_vibration_hides_it_in_rows(tmp_path, factor):
    """Rows correlate with about 0.7, means over 0.2 s with more than 0.9."""
    *_, turn, rate = flown()
    shaken = rate + 0.6 * np.std(rate) * np.random.default_rng(3).standard_normal(rate.shape)
    unit = "rad/s" if factor > 1.0 else "deg/s"
    names = [f"gyro_{a} [{unit}]" for a in "xyz"]
    columns = {"t": flown()[0], **dict(zip(names, (factor * shaken).T, strict=True)),
               **dict(zip(("qx", "qy", "qz", "qw"), turn.as_quat().T, strict=True))}
    rows = [",".join(columns), *(",".join(f"{c:.6g}" for c in row) for row in zip(*columns.values(), strict=True))]
    (tmp_path / "flight.csv").write_text("\n".join(rows) + "\n")
    draft = draft_columns(tmp_path / "flight.csv")
    assert ("imu", "gyro_x") not in draft.mapped
    assert "times as fast as the attitude" in draft.questions[0]


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_coordinate_in_every_other_row_is_drafted_without_a_warning(tmp_path):
    t, p, *_ = flown()
    rows = [f"{s:.6g},{x:.6g},{'' if i % 2 else f'{y:.6g}'},{z:.6g}" for i, (s, (x, y, z)) in enumerate(
        zip(t, p, strict=True))]
    (tmp_path / "flight.csv").write_text("\n".join(["t,x,y,z", *rows]) + "\n")
    assert ("mocap", "px") in draft_columns(tmp_path / "flight.csv").mapped
