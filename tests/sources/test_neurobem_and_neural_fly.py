"""NeuroBEM and Neural-Fly, written to the facts of the formats from a flight that is known."""

from __future__ import annotations

import numpy as np
import pytest
from test_draft_axes import G, flown
from text_mutations import SEEDS, mutations, read_as_before

from nanobench_tools.sources import load_recordings

ROTORS = np.array([1000.0, 1010.0, 1020.0, 1030.0])


def table(columns):
    rows = [",".join(columns), *(",".join(f"{v:.9g}" for v in row) for row in zip(*columns.values(), strict=True))]
    return ("\n".join(rows) + "\n").encode()


def cycle(form, values, axes="xyz"):
    return {form.format(a): values[:, k] for k, a in enumerate(axes)}


def neurobem(**changed):
    t, p, v, a, turn, w = flown()
    columns = {"t": t, **cycle("ang acc {}", 0.0 * w), **cycle("ang vel {}", w),
               **cycle("quat {}", turn.as_quat(), "xyzw"), **cycle("acc {}", turn.inv().apply(a + G)),
               **cycle("vel {}", turn.inv().apply(v)), **cycle("pos {}", p)}
    columns |= {f"mot {k + 1}": np.full(len(t), rotor) for k, rotor in enumerate(ROTORS)}
    columns |= {f"dmot {k}": 0.0 * t for k in (1, 2, 3, 4)} | {"vbat": np.full(len(t), 15.9)}
    return columns | changed


def neural_fly(turned=1.0):
    t, p, v, _, turn, w = flown()
    q = turn.as_quat() * np.array([turned, turned, 1.0, 1.0])

    def listed(values):
        return '"[' + ", ".join(f"{x:.9g}" for x in values) + ']"'

    rows = [",t,p,p_d,v,v_d,q,R,w,T_sp,q_sp,hover_throttle,fa,pwm"]
    for k in range(len(t)):
        matrix = '"[' + ", ".join(listed(r).strip('"') for r in turn[k].as_matrix()) + ']"'
        rows.append(",".join([str(k), f"{t[k]:.9g}", *map(listed, (p[k], p[k] + 0.1, v[k], v[k], q[k])), matrix,
                              listed(w[k]), "[0.45]", listed(q[k]), "[0.447]", listed(0.0 * p[k]), listed(ROTORS)]))
    return ("\n".join(rows) + "\n").encode()


def read(tmp_path, data):
    (tmp_path / "a.csv").write_bytes(data)
    return load_recordings([tmp_path / "a.csv"], cache=False)


def test_neurobem(tmp_path):
    (flight,) = read(tmp_path, table(neurobem())).flights
    t, p, v, _, turn, w = flown()
    assert (flight.provenance.source, flight.provenance.findings) == ("neurobem", ())
    assert set(flight.streams) == {"mocap", "rpm", "battery", "extra_acceleration"}
    mocap = flight["mocap"]
    np.testing.assert_allclose(mocap.time_s, t, atol=1e-9)
    np.testing.assert_allclose(mocap["px", "py", "pz"], p, atol=1e-8)
    np.testing.assert_allclose(mocap["vx", "vy", "vz"], v, atol=1e-7)
    np.testing.assert_allclose(mocap["wx", "wy", "wz"], w, atol=1e-7)
    assert (type(turn).from_quat(mocap["qx", "qy", "qz", "qw"]).inv() * turn).magnitude().max() < 1e-6
    np.testing.assert_allclose(flight["rpm"].values[0], ROTORS[[1, 0, 2, 3]])
    notes = " ".join(flight.provenance.notes)
    assert "velocity turned from the body" in notes
    assert "with gravity" in notes


def test_neurobem_in_other_units_and_frames(tmp_path):
    _, _, v, a, turn, _ = flown()
    (flight,) = read(tmp_path, table(neurobem(**cycle("vel {}", v)))).flights
    np.testing.assert_allclose(flight["mocap"]["vx", "vy", "vz"], v, atol=1e-7)
    (flight,) = read(tmp_path, table(neurobem(**cycle("vel {}", 3.6 * turn.inv().apply(v))))).flights
    assert "vx" not in flight["mocap"]
    rpm = {f"mot {k}": np.full(len(v), 9800.0) for k in (1, 2, 3, 4)}
    (flight,) = read(tmp_path, table(neurobem(**rpm))).flights
    assert "rpm" not in flight
    (flight,) = read(tmp_path, table(neurobem(**cycle("acc {}", turn.inv().apply(a))))).flights
    assert any("without gravity" in n for n in flight.provenance.notes)
    assert "no seconds" in read(tmp_path, table(neurobem(t=1e9 * flown()[0]))).failed[0]["error"]
    (flight,) = read(tmp_path, table({n.replace("quat ", "q"): c for n, c in neurobem().items()})).flights
    assert flight.provenance.source == "neurobem"


def test_neural_fly(tmp_path):
    (flight,) = read(tmp_path, neural_fly()).flights
    t, p, v, _, turn, w = flown()
    assert (flight.provenance.source, flight.provenance.findings) == ("neural_fly", ())
    assert set(flight.streams) == {"estimator", "attitude_qw", "imu", "setpoint", "command", "extra_pwm"}
    np.testing.assert_allclose(flight["estimator"].time_s, t, atol=1e-9)
    np.testing.assert_allclose(flight["estimator"]["x", "y", "z", "vx", "vy", "vz"], np.hstack([p, v]), atol=1e-7)
    np.testing.assert_allclose(flight["attitude_qw"]["qx", "qy", "qz", "qw"], turn.as_quat(), atol=1e-7)
    np.testing.assert_allclose(flight["imu"]["gyro_x", "gyro_y", "gyro_z"], w, atol=1e-7)
    np.testing.assert_allclose(flight["setpoint"]["x", "y", "z"], p + 0.1, atol=1e-7)
    np.testing.assert_allclose(flight["command"]["thrust"], 0.45)
    np.testing.assert_allclose(flight["extra_pwm"].values[0], ROTORS)
    assert any("tilt and acceleration agree" in n for n in flight.provenance.notes)


def test_neural_fly_that_tilts_the_other_way_is_refused(tmp_path):
    assert "tilts against its acceleration" in read(tmp_path, neural_fly(turned=-1.0)).failed[0]["error"]


@pytest.mark.parametrize("seeds", SEEDS)
@pytest.mark.parametrize("data", [table(neurobem()), b"\n".join([*neural_fly().split(b"\n")[:201], b""])],
                         ids=["neurobem", "neural_fly"])
def test_damage_gives_no_other_number(tmp_path, data, seeds):
    (before,) = read(tmp_path, data).flights
    read_ones = [read_as_before(tmp_path, damaged, before) for damaged in mutations(data, seeds)]
    assert len(read_ones) == 9 * seeds
    assert sum(flight is not None for flight in read_ones) >= 5 * seeds


def test_quaternions_without_unit_length_are_missing(tmp_path):
    columns = neurobem()
    columns["quat x"] = np.where(np.arange(len(columns["t"])) == 7, 2.0, columns["quat x"])
    (flight,) = read(tmp_path, table(columns)).flights
    assert any("1 quaternions without unit length" in f.evidence for f in flight.provenance.findings)
    assert np.isnan(flight["mocap"]["qw"][7])
