"""Drafted maps of tables whose vectors are in other axes or units than their names suggest: asked about or left out."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from nanobench_tools.errors import InputError
from nanobench_tools.signals.column_draft import draft_columns

STEP_S = 0.02
G = np.array([0.0, 0.0, 9.81])


@functools.cache
def flown():
    """Columns of a flight of 16 s: a circle with a turn of 80 degrees; the attitude follows from the thrust."""
    t = np.arange(0.0, 16.0, STEP_S)
    ramp = np.clip((t - 3.0) / 3.0, 0.0, 1.0) * np.clip((13.0 - t) / 3.0, 0.0, 1.0)
    ramp = ramp * ramp * (3.0 - 2.0 * ramp)
    p = np.stack([ramp * np.sin(1.5 * t), 0.7 * ramp * np.sin(2.5 * t), ramp], axis=1)
    v = np.gradient(p, STEP_S, axis=0)
    a = np.gradient(v, STEP_S, axis=0)
    up = (a + G) / np.linalg.norm(a + G, axis=1, keepdims=True)
    yaw = 1.4 * ramp
    left = np.cross(up, np.stack([np.cos(yaw), np.sin(yaw), 0.0 * yaw], axis=1))
    left /= np.linalg.norm(left, axis=1, keepdims=True)
    turn = Rotation.from_matrix(np.stack([np.cross(left, up), left, up], axis=2))
    w = np.gradient(turn.as_quat(), STEP_S, axis=0)
    q = turn.as_quat()
    rate = 2.0 * (q[:, 3:] * w[:, :3] - w[:, 3:] * q[:, :3] - np.cross(q[:, :3], w[:, :3]))
    rng = np.random.default_rng(5)
    return t, p + 3e-4 * rng.standard_normal(p.shape), v, a, turn, rate + 0.01 * rng.standard_normal(p.shape)


def drafted(tmp_path, time=1.0, place=(1.0, 1.0, 1.0), **vectors):
    """The draft of a table with time, position, attitude and these vectors: name with ? for the axis -> (n, 3).

    time, place: factors of their columns."""
    t, p, _, _, turn, _ = flown()
    columns = {"t": time * t, **{a: place[i] * p[:, i] for i, a in enumerate("xyz")}}
    columns |= {f"q{a}": turn.as_quat()[:, i] for i, a in enumerate("xyzw")}
    for name, vector in vectors.items():
        columns |= {name.replace("_AXIS", f"_{a}"): vector[:, i] for i, a in enumerate("xyz")}
    rows = [",".join(columns), *(",".join(f"{c:.6g}" for c in row) for row in zip(*columns.values(), strict=True))]
    (tmp_path / "flight.csv").write_text("\n".join(rows) + "\n")
    return draft_columns(tmp_path / "flight.csv")


def test_vectors_in_their_own_axes_are_drafted(tmp_path):
    _, _, v, a, turn, w = flown()
    draft = drafted(tmp_path, vel_AXIS=v, acc_AXIS=turn.inv().apply(a + G), gyro_AXIS=w)
    assert draft.questions == ()
    assert {("mocap", "vx"), ("imu", "acc_y"), ("imu", "gyro_z")} <= set(draft.mapped)


@pytest.mark.parametrize(("name", "key", "says"), [
    ("vel", ("mocap", "vx"), "a velocity in the body frame"), ("acc", ("imu", "acc_x"), "in the axes of the world"),
    ("gyro", ("imu", "gyro_x"), "in the axes of the world"), ("acc", ("imu", "acc_z"), "without gravity")])
def test_vectors_in_other_axes_are_not(tmp_path, name, key, says):
    _, _, v, a, turn, w = flown()
    wrong = {"vel": turn.inv().apply(v), "gyro": turn.apply(w),
             "acc": turn.inv().apply(a) if "gravity" in says else a + G}[name]
    draft = drafted(tmp_path, **{f"{name}_AXIS": wrong})
    assert key not in draft.mapped
    assert says in " ".join(draft.unknown.values())
    assert ("mocap", "px") in draft.mapped


@pytest.mark.parametrize("number", [-9999.0, 99999.0, 0.0])
def test_a_number_that_a_tracker_writes_for_a_body_it_lost_is_no_length(tmp_path, number):
    t, p, *_ = flown()
    place = p.copy()
    place[400:430] = number
    rows = [",".join(("t", "x", "y", "z")), *(",".join(f"{c:.6g}" for c in row) for row in np.column_stack([t, place]))]
    (tmp_path / "flight.csv").write_text("\n".join(rows) + "\n")
    draft = draft_columns(tmp_path / "flight.csv")
    assert [draft.mapped.get(("mocap", q)) for q in ("px", "py", "pz")] == [(a, "m") for a in "xyz"]


@pytest.mark.parametrize("turned", [-1.0, np.array([1.0, 1.0, -1.0]), np.array([1.0, -1.0, -1.0])],
                         ids=["all three", "z alone", "FRD, the gyro not"])
def test_an_accelerometer_upside_down_beside_a_gyro_that_is_not_is_a_question(tmp_path, turned):
    """Gravity shows the sign of z alone, and with one sign turned the axes of a negated sensor stay a mirror image."""
    _, _, _, a, turn, w = flown()
    draft = drafted(tmp_path, acc_AXIS=turned * turn.inv().apply(a + G), gyro_AXIS=w)
    assert ("imu", "acc_x") not in draft.mapped
    assert ("imu", "gyro_x") in draft.mapped
    assert "sign = -1 at all three" in " ".join(draft.questions)


@pytest.mark.parametrize("changed", [{"time": 0.01}, {"time": 100.0}, {"place": (1.0, 1.0, 12.0)},
                                     {"place": (0.1, 0.1, 0.1)}])
def test_a_path_that_the_accelerometer_contradicts_is_asked_about(tmp_path, changed):
    _, _, _, a, turn, w = flown()
    force = turn.inv().apply(a + G) + 0.05 * np.random.default_rng(6).standard_normal(a.shape)
    draft = drafted(tmp_path, **changed, acc_AXIS=force, gyro_AXIS=w)
    assert ("mocap", "pz") not in draft.mapped
    assert draft.questions


@pytest.mark.parametrize(("factor", "unit"), [(1.0, "m/s^2"), (1.0 / 9.81, "g")])
def test_an_estimated_acceleration_has_the_unit_of_the_rate_of_its_velocity(tmp_path, factor, unit):
    _, _, v, a, _, _ = flown()
    draft = drafted(tmp_path, ekf_vel_AXIS=v, ekf_acc_AXIS=factor * a)
    assert draft.mapped["estimator_acc", "ax"] == ("ekf_acc_x", unit)
    assert draft.status["ekf_acc_x"] == "shown"


def test_the_sign_of_a_pitch_follows_from_the_gyro(tmp_path):
    t, p, _, _, turn, w = flown()
    angles = turn.as_euler("ZYX", degrees=True)[:, ::-1]
    for sign in (1, -1):
        rows = ["t,x,y,z,roll_deg,pitch_deg,yaw_deg,gyro_x,gyro_y,gyro_z"]
        rows += [",".join(f"{c:.6g}" for c in (*row, *at, *turning)) for row, at, turning in zip(
            np.column_stack([t, p]), angles * [1, sign, 1], w, strict=True)]
        (tmp_path / "flight.csv").write_text("\n".join(rows) + "\n")
        draft = draft_columns(tmp_path / "flight.csv")
        assert ('unit = "deg", sign = -1}' in draft.text) == (sign < 0)


@pytest.mark.parametrize(("signs", "sign", "asked"), [
    ((1, 1, 1), -1, []), ((1, -1, 1), 1, []), ((-1, 1, 1), -1, ["stabilizer.roll, gyro.x"]),
    ((1, 1, -1), -1, ["stabilizer.yaw, gyro.z"])], ids=["as logged", "pitch", "roll", "yaw"])
def test_the_gyro_shows_signs_of_known_names_too(tmp_path, signs, sign, asked):
    """A Crazyflie logs its pitch positive nose up; a user may have turned it, or another angle."""
    t, _, _, _, turn, w = flown()
    angles = turn.as_euler("ZYX", degrees=True)[:, ::-1] * [1, -1, 1] * signs
    np.savetxt(tmp_path / "log.csv", np.column_stack([1e3 * t, angles, np.rad2deg(w)]), delimiter=",", fmt="%.6g",
               comments="", header="Timestamp," + ",".join(
                   [f"stabilizer.{a}" for a in ("roll", "pitch", "yaw")] + [f"gyro.{a}" for a in "xyz"]))
    draft = draft_columns(tmp_path / "log.csv")
    assert [q.partition(":")[0] for q in draft.questions] == asked
    assert ('"stabilizer.pitch", unit = "deg", sign = -1}' in draft.text) == (sign < 0)
    assert any("since the gyro turns the other way" in note for note in draft.notes) == (sign > 0)
    assert draft.status["stabilizer.pitch"] == ("assumed" if sign > 0 else "known")


@pytest.mark.parametrize(("scale", "size", "rising", "drafted"), [
    (1.0, 1.0, 1.0, ("rad/s", "shown")), (57.2958, 1.0, 1.0, ("deg/s", "shown")),
    (57.2958, 1.0, 57.2958, ("rad/s", "assumed")), (1.0, 40.0, 0.0, ("rad/s", "assumed")), (8.0, 1.0, 1.0, None)],
    ids=["rad/s", "deg/s", "both in degrees", "alone", "neither"])
def test_a_generic_name_does_not_make_the_unit_of_a_gyro_known(tmp_path, scale, size, rising, drafted):
    """Peak 0.4 rad/s times ``size``; its rate is in the table, too, unless ``rising`` is 0."""
    t = np.arange(0.0, 10.0, 0.02)
    w = size * 0.4 * np.sin(np.array([1.0, 1.6, 2.3]) * t[:, None])
    a = size * 0.4 * np.array([1.0, 1.6, 2.3]) * np.cos(np.array([1.0, 1.6, 2.3]) * t[:, None])
    names = [f"ang_vel_{x}" for x in "xyz"] + [f"ang_acc_{x}" for x in "xyz"] * (rising > 0.0)
    np.savetxt(tmp_path / "f.csv", np.column_stack([t, scale * w, *[rising * a] * (rising > 0.0)]), delimiter=",",
               fmt="%.6g", comments="", header="timestamp," + ",".join(names))
    if drafted is None:
        with pytest.raises(InputError, match="times the angular acceleration"):
            draft_columns(tmp_path / "f.csv")
        return
    draft = draft_columns(tmp_path / "f.csv")
    assert (draft.mapped["imu", "gyro_x"][1], draft.status["ang_vel_x"]) == drafted


def test_a_unit_that_is_not_known_is_a_question(tmp_path):
    (tmp_path / "f.csv").write_text("t,x [yd],y [yd],z [yd],vbat\n" + "".join(
        f"{0.01 * i},{0.1 * i},{0.2 * i},1,{4.0 - 1e-4 * i}\n" for i in range(200)))
    draft = draft_columns(tmp_path / "f.csv")
    assert ("mocap", "px") not in draft.mapped
    assert "its unit 'yd' is none of m, mm, cm, in, ft; convert it" in draft.questions[0]


@pytest.mark.parametrize("gyro", [True, False])
@pytest.mark.parametrize(("stored", "read"), [
    (lambda q: q * [-1, -1, -1, 1], [("qx", -1), ("qy", -1), ("qz", -1), ("qw", 1)]),
    (lambda q: q[:, [3, 0, 1, 2]], [("qy", 1), ("qz", 1), ("qw", 1), ("qx", 1)]),
    (lambda q: q[:, [1, 2, 3, 0]], [("qw", 1), ("qx", 1), ("qy", 1), ("qz", 1)]),
])
def test_quaternions_are_read_as_the_flight_shows(tmp_path, stored, read, gyro):
    t, p, _, _, turn, w = flown()
    columns = {"t": t, **{n: p[:, i] for i, n in enumerate("xyz")}}
    columns |= {f"q{n}": stored(turn.as_quat())[:, i] for i, n in enumerate("xyzw")}
    columns |= {f"gyro_{n}": w[:, i] for i, n in enumerate("xyz")} if gyro else {}
    rows = [",".join(columns), *(",".join(f"{c:.6g}" for c in row) for row in zip(*columns.values(), strict=True))]
    (tmp_path / "flight.csv").write_text("\n".join(rows) + "\n")
    draft = draft_columns(tmp_path / "flight.csv")
    signs = [-1 if f"column = \"{column}\", unit = \"1\", sign = -1" in draft.text else 1 for column, _ in read]
    assert [draft.mapped["mocap", q][0] for q in ("qx", "qy", "qz", "qw")] == [column for column, _ in read]
    assert signs == [sign for _, sign in read]
    assert any("read so, since" in note for note in draft.notes)


def table_of(tmp_path, columns):
    rows = [",".join(columns), *(",".join(f"{c:.6g}" for c in row) for row in zip(*columns.values(), strict=True))]
    (tmp_path / "flight.csv").write_text("\n".join(rows) + "\n")
    return draft_columns(tmp_path / "flight.csv")


@pytest.mark.parametrize(("also", "status"), [("path", "shown"), ("acc", "shown"), ("", "assumed")])
def test_a_gyro_alone_does_not_show_the_sign_of_a_pitch(tmp_path, also, status):
    """Its axis may be the one that is negated."""
    t, p, _, a, turn, w = flown()
    yaw, pitch, roll = np.rad2deg(turn.as_euler("ZYX")).T
    further = {"path": dict(zip("xyz", p.T, strict=True)), "": {}, "acc": dict(zip(
        ("acc_x", "acc_y", "acc_z"), turn.inv().apply(a + G).T, strict=True))}[also]
    draft = table_of(tmp_path, {"t": t, "roll_deg": roll, "pitch_deg": -pitch, "yaw_deg": yaw, **further,
                                **{f"gyro_{n}": w[:, i] for i, n in enumerate("xyz")}})
    assert 'column = "pitch_deg", unit = "deg", sign = -1' in draft.text
    assert draft.status["pitch_deg"] == status
    assert any("check it" in note for note in draft.notes if note.startswith("pitch_deg")) == (status == "assumed")


def test_exchanged_angles_and_a_yaw_of_a_whole_turn_are_asked_about(tmp_path):
    t, _, _, _, turn, w = flown()
    yaw, pitch, roll = turn.as_euler("ZYX").T
    gyro = {f"gyro_{n}": w[:, i] for i, n in enumerate("xyz")}
    swapped = table_of(tmp_path, {"t": t, "roll": pitch, "pitch": roll, "yaw": yaw, **gyro})
    assert any("changed places" in q for q in swapped.questions)
    turned = table_of(tmp_path, {"t": t, "roll": roll, "pitch": pitch, "yaw": np.mod(yaw - 0.3, 2 * np.pi), **gyro})
    assert any("rad or deg" in q for q in turned.questions)
    assert not any("gyro_x" in note and "deg/s" in note for note in turned.notes)


@pytest.mark.parametrize(("per_unit", "known"), [(1e3, True), (16.4 * 180 / np.pi, False)])
def test_a_gyro_in_counts_is_not_in_mrad(tmp_path, per_unit, known):
    _, _, _, _, _, w = flown()
    draft = drafted(tmp_path, gyro_AXIS=per_unit * w)
    assert (("imu", "gyro_x") in draft.mapped) is known
    assert bool(draft.questions) is not known


@pytest.mark.parametrize(("per_unit", "known"), [(1e3 / 9.81, True), (100.0, False), (1024 / 9.81, False)])
def test_an_accelerometer_in_counts_is_not_in_mg(tmp_path, per_unit, known):
    _, _, _, a, turn, _ = flown()
    draft = drafted(tmp_path, acc_AXIS=per_unit * turn.inv().apply(a + G))
    assert (("imu", "acc_x") in draft.mapped) is known


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_path_shows_the_sign_of_a_pitch_without_a_gyro(tmp_path, sign):
    t, p, _, _, turn, _ = flown()
    yaw, pitch, roll = turn.as_euler("ZYX").T
    columns = {"t": t, **{n: p[:, i] for i, n in enumerate("xyz")}, "roll": roll, "pitch": sign * pitch, "yaw": yaw}
    rows = [",".join(columns), *(",".join(f"{c:.6g}" for c in row) for row in zip(*columns.values(), strict=True))]
    (tmp_path / "flight.csv").write_text("\n".join(rows) + "\n")
    draft = draft_columns(tmp_path / "flight.csv")
    assert ('column = "pitch", unit = "rad", sign = -1' in draft.text) == (sign < 0.0)
    assert draft.questions == ()
    assert not any("taken as positive" in note for note in draft.notes)
