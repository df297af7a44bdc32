"""Times, numbered columns, missing readings and PX4 topics as other programs write them, through a drafted map."""

from __future__ import annotations

import numpy as np
import pytest
from test_draft_axes import G, flown

from nanobench_tools.errors import InputError
from nanobench_tools.signals.column_draft import draft_columns
from nanobench_tools.sources import load_recordings
from nanobench_tools.sources.column_names import meaning

TURN = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""From east, north, up to north, east, down."""
FRD = np.array([1.0, -1.0, -1.0])


def written(folder, columns, name="flight.csv"):
    rows = [",".join(c if isinstance(c, str) else f"{c:.10g}" for c in row)
            for row in zip(*columns.values(), strict=True)]
    (folder / name).write_text("\n".join([",".join(columns), *rows]) + "\n")
    return folder / name


def read(path):
    draft = draft_columns(path)
    (path.parent / "map.toml").write_text(draft.text)
    return load_recordings([path], columns=path.parent / "map.toml", cache=False).flights[0], draft


def vector(names, values):
    return dict(zip(names, values.T, strict=True))


@pytest.mark.parametrize(("name", "cell"), [
    ("Time", lambda s: f"{s:.2f} sec"), ("Time", lambda s: f"{s / 60.0:.9f} min"),
    ("time", lambda s: f"{(s + 3590.0) // 60.0 % 60.0:.0f}:{(s + 3590.0) % 60.0:06.3f}"),
    ("time [min]", lambda s: f"{s / 60.0:.9f}"), ("time (h)", lambda s: f"{s / 3600.0:.12f}"),
    ("utime", lambda s: f"{1e6 * s + 1.7e15:.0f}")],
    ids=["durations of MATLAB", "in minutes", "minutes and seconds past the hour", "[min]", "(h)", "utime"])
def test_times(tmp_path, name, cell):
    t, p, *_ = flown()
    flight, _ = read(written(tmp_path, {name: [cell(s) for s in t], **vector(("px", "py", "pz"), p)}))
    np.testing.assert_allclose(flight["mocap"].time_s, t, atol=2e-6)


def test_a_unit_of_time_that_is_not_known_is_refused(tmp_path):
    t, p, *_ = flown()
    with pytest.raises(InputError, match="its unit 'days' is none of s, ms"):
        draft_columns(written(tmp_path, {"time [days]": t / 86400.0, **vector(("px", "py", "pz"), p)}))


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("stem", ["pos_{}", "position[{}]", "Position{}"])
def test_vectors_by_number(tmp_path, stem, first):
    t, p, v, *_ = flown()
    names = [stem.format(k + first) for k in range(3)]
    speeds = [f"vel_{k + first}" for k in range(3)]
    flight, _ = read(written(tmp_path, {"t": t, **vector(names, p), **vector(speeds, v)}))
    np.testing.assert_allclose(flight["mocap"]["px", "py", "pz"], p, atol=1e-8)
    np.testing.assert_allclose(flight["mocap"]["vx", "vy", "vz"], v, atol=1e-8)


def test_numbers_of_motors_stay_motors(tmp_path):
    t, p, *_ = flown()
    shares = {f"motor_{k}": 0.5 + 0.1 * np.sin(t + k) for k in (1, 2, 3)}
    draft = draft_columns(written(tmp_path, {"t": t, **vector(("px", "py", "pz"), p), **shares}))
    assert not any(name.startswith("gyro") or name.startswith("v") for _, name in draft.mapped)


@pytest.mark.parametrize("cell", ["-", "--", "#N/A", "n/a", "9999", "-9999", "99999"])
def test_missing_readings(tmp_path, cell):
    t, p, _, a, turn, w = flown()
    names = ("px", "py", "pz", "acc_x", "acc_y", "acc_z", "gyro_x", "gyro_y", "gyro_z")
    values = np.hstack([p, turn.inv().apply(a + G), w])
    lost = np.arange(len(t)) % 7 == 3
    columns = {n: [cell if gone else float(v) for v, gone in zip(column, lost, strict=True)]
               for n, column in zip(names, values.T, strict=True)}
    flight, _ = read(written(tmp_path, {"t": t, **columns}))
    np.testing.assert_allclose(np.hstack([flight["mocap"].values, flight["imu"].values]), values[~lost], atol=1e-8)
    assert not flight.provenance.findings


def test_a_number_of_nines_near_others_is_a_reading(tmp_path):
    t, p, *_ = flown()
    height = 1e3 * p[:, 2] + 9000.0
    height[100:110] = 9999.0
    draft = draft_columns(written(tmp_path, {"t": t, "x [mm]": 1e3 * p[:, 0], "y [mm]": 1e3 * p[:, 1],
                                             "z [mm]": height}))
    assert not any("is no reading" in note for note in draft.notes)


@pytest.mark.parametrize("name", ["log_vehicle_odometry_0.csv", "vehicle_odometry-cut.csv", "renamed.csv"])
def test_an_odometry_of_px4_is_the_estimate_in_ned_by_any_file_name(tmp_path, name):
    t, p, v, _, turn, w = flown()
    ned = turn.from_matrix(np.tile(TURN, (len(t), 1, 1))) * turn * turn.from_matrix(np.diag(FRD))
    q = ned.as_quat()[:, [3, 0, 1, 2]]
    flight, _ = read(written(tmp_path, {
        "timestamp": 1e6 * t + 5e8, "pose_frame": 0.0 * t + 1.0, "velocity_frame": 0.0 * t + 1.0,
        **vector([f"position[{k}]" for k in range(3)], p @ TURN.T), **vector([f"q[{k}]" for k in range(4)], q),
        **vector([f"velocity[{k}]" for k in range(3)], v @ TURN.T),
        **vector([f"angular_velocity[{k}]" for k in range(3)], w * FRD)}, name))
    assert set(flight.streams) == {"estimator", "attitude_qw"}
    np.testing.assert_allclose(flight["estimator"]["x", "y", "z"], p, atol=1e-6)
    apart = (turn.from_quat(flight["attitude_qw"]["qx", "qy", "qz", "qw"]).inv() * turn).magnitude()
    assert apart.max() < 1e-6


def test_a_pitch_whose_sign_nothing_shows_is_assumed_in_every_audit(tmp_path):
    t, _, _, _, turn, _ = flown()
    angles = turn.as_euler("ZYX", degrees=True)[:, ::-1]
    flight, draft = read(written(tmp_path, {"t": t, **vector(("roll (deg)", "pitch (deg)", "yaw (deg)"), angles)}))
    assert draft.status["pitch (deg)"] == "assumed"
    assert [a.unit for a in flight.provenance.assumptions] == ["deg, positive nose down",
                                                               "deg, positive counter-clockwise"]


def test_a_height_in_feet_is_not_shown_by_the_tilt(tmp_path):
    t, p, _, _, turn, _ = flown()
    draft = draft_columns(written(tmp_path, {
        "t": t, "px": p[:, 0], "py": p[:, 1], "pz": p[:, 2] / 0.3048,
        **vector(("qx", "qy", "qz", "qw"), turn.as_quat())}))
    assert [draft.status[c] for c in ("px", "py", "pz")] == ["shown", "shown", "assumed"]


@pytest.mark.parametrize("names", [("phi", "theta", "psi"), ("att_phi", "att_theta", "att_psi")])
def test_greek_angles(tmp_path, names):
    t, p, _, _, turn, w = flown()
    angles = turn.as_euler("ZYX")[:, ::-1]
    flight, _ = read(written(tmp_path, {"t": t, **vector(names, angles), **vector(("p", "q", "r"), w),
                                        **vector(("px", "py", "pz"), p)}))
    np.testing.assert_allclose(flight["attitude"]["roll", "pitch", "yaw"], angles, atol=1e-8)
    np.testing.assert_allclose(flight["imu"]["gyro_x", "gyro_y", "gyro_z"], w, atol=1e-8)


def test_units_in_names_as_matlab_allows_them(tmp_path):
    t, p, v, a, turn, w = flown()
    force = turn.inv().apply(a + G)
    flight, draft = read(written(tmp_path, {
        "time_s": t, **vector(("pos_x_m", "pos_y_m", "pos_z_m"), p), **vector(("p_radps", "q_radps", "r_radps"), w),
        **vector(("vel_x_mps", "vel_y_mps", "vel_z_mps"), v), **vector(("acc_x_mps2", "acc_y_mps2", "acc_z_mps2"),
                                                                       force)}))
    assert {*draft.status.values()} == {"known"}
    np.testing.assert_allclose(flight["mocap"]["vx", "vy", "vz"], v, atol=1e-8)
    np.testing.assert_allclose(flight["imu"].values, np.hstack([w, force]), atol=1e-8)


def test_the_orientation_of_an_inertial_sensor_is_no_motion_capture(tmp_path):
    t, _, _, a, turn, w = flown()
    message = {"orientation": turn.as_quat(), "angular_velocity": w, "linear_acceleration": turn.inv().apply(a + G)}
    flight, draft = read(written(tmp_path, {"%time": 1e9 * t + 1.7e18} | {
        f"field.{name}.{axis}": column for name, values in message.items()
        for axis, column in zip("xyzw", values.T, strict=False)}))
    assert set(flight.streams) == {"imu"}
    assert "attitude_qw" in draft.unknown["field.orientation.x"]


def test_one_greek_angle_alone_is_no_pitch(tmp_path):
    t, p, _, _, turn, _ = flown()
    draft = draft_columns(written(tmp_path, {"t": t, **vector(("px", "py", "pz"), p), "theta": turn.magnitude()}))
    assert ("attitude", "pitch") not in draft.mapped


def in_turns(kinds, values):
    """A table whose rows are of several ``kinds`` in turns: (name of the column, its texts), (texts -> (n, 3))."""
    name, texts = kinds
    t = np.repeat(flown()[0], len(texts))
    rows = np.stack(values, axis=1).reshape(-1, 3)
    return {"t": t, name: list(texts) * len(flown()[0]), **vector(("x", "y", "z"), rows)}


@pytest.mark.parametrize("kinds", [("sensor", ("acc", "gyro")), ("topic", ("/a", "/b")), ("rb_id", ("1", "2")),
                                   ("kind", ("acc", "gyro"))])
def test_rows_of_several_sensors_or_bodies_are_refused(tmp_path, kinds):
    _, p, _, _, _, w = flown()
    with pytest.raises(InputError, match="take turns"):
        draft_columns(written(tmp_path, in_turns(kinds, (p, w))))


@pytest.mark.parametrize("column", [("mode", ["HOVER"] * 300 + ["FLY"] * 500), ("rb_id", ["7"] * 800),
                                    ("status", ["OK", *["LOST"] * 3, *["OK"] * 46] * 16)])
def test_a_state_that_stays_is_no_turn(tmp_path, column):
    t, p, *_ = flown()
    flight, _ = read(written(tmp_path, {"t": t, column[0]: column[1], **vector(("x", "y", "z"), p)}))
    np.testing.assert_allclose(flight["mocap"]["px", "py", "pz"], p, atol=1e-8)


def test_letters_by_number_are_no_vector(tmp_path):
    """v1 is any value."""
    t, p, *_ = flown()
    with pytest.raises(InputError, match="no column except 't'"):
        draft_columns(written(tmp_path, {"t": t, **vector(("v1", "v2", "v3"), p)}))


@pytest.mark.parametrize("stem", ["thrust_{}", "u{}", "motor_{}", "rpm_{}", "imu_{}", "sensor_{}", "angular_{}",
                                  "vbat_{}", "acc_world_{}", "gyro_global_{}", "time_{}"])
def test_words_that_make_no_position_and_no_inertial_sensor(stem):
    assert all(isinstance(meaning(stem.format(axis)), str) for axis in "xyz")


@pytest.mark.parametrize(("name", "key"), [("pos_imu_q_x", ("attitude_qw", "qx")), ("imu_qw", ("attitude_qw", "qw")),
                                           ("body_x", ("mocap", "px")), ("world_pos_y", ("mocap", "py"))])
def test_words_that_may_stand_before_others(name, key):
    assert meaning(name) == key


@pytest.mark.parametrize("name", ["esc_voltage_1", "rpm_cmd_1", "rotor_ref_2"])
def test_voltages_and_commanded_speeds_of_motors_are_no_commands(name):
    assert "which no task uses" in meaning(name)


DOWN = np.array([1.0, -1.0, -1.0])


def aviation(folder, *, path=True, force=False, sign=DOWN):
    """Angles and a gyro of a body with z down (or up)."""
    t, p, _, a, turn, w = flown()
    columns = {"t": t, **vector(("phi", "theta", "psi"), sign * turn.as_euler("ZYX")[:, ::-1]),
               **vector(("p", "q", "r"), sign * w)}
    columns |= vector(("px", "py", "pz"), p) if path else {}
    columns |= vector(("acc_x", "acc_y", "acc_z"), turn.inv().apply(a + G)) if force else {}
    return draft_columns(written(folder, columns))


def test_the_path_shows_a_body_with_z_down_though_angles_and_gyro_agree(tmp_path):
    draft = aviation(tmp_path)
    assert not {"attitude", "imu"} & {stream for stream, _ in draft.mapped}
    assert "Is z of the body down?" in draft.questions[0]


@pytest.mark.parametrize(("path", "force"), [(True, False), (False, True)])
def test_path_or_accelerometer_show_the_sign_of_a_pitch(tmp_path, path, force):
    draft = aviation(tmp_path, path=path, force=force, sign=1.0)
    assert draft.questions == ()
    assert not any("positive nose down" in note for note in draft.notes)


def test_a_negated_gyro_is_a_question_where_the_path_shows_the_pitch(tmp_path):
    t, p, _, _, turn, w = flown()
    draft = draft_columns(written(tmp_path, {
        "t": t, **vector(("px", "py", "pz"), p), **vector(("roll", "pitch", "yaw"), turn.as_euler("ZYX")[:, ::-1]),
        **vector(("gyro_x", "gyro_y", "gyro_z"), w * [1.0, -1.0, 1.0])}))
    assert ("imu", "gyro_y") not in draft.mapped
    assert "gyro_y: it turns against the pitch" in draft.questions[0]
    assert "sign" not in draft.text.split("pitch = ")[1].splitlines()[0]


def test_angles_and_gyro_alone_leave_both_signs_assumed(tmp_path):
    draft = aviation(tmp_path, path=False)
    assert {draft.status[c] for c in ("theta", "psi", "q", "r")} == {"assumed"}


def test_two_columns_of_one_meaning_and_other_values_are_a_question(tmp_path):
    t, p, *_ = flown()
    other = p + np.array([1.0, 0.0, 0.0])
    table = {"t": t, **vector(("x [m]", "y [m]", "z [m]"), p), **vector(("px [m]", "py [m]", "pz [m]"), other),
             "vbat": 4.0 - 0.01 * t}
    _, draft = read(written(tmp_path, table))
    assert set(draft.mapped) == {("", "time"), ("mocap", "py"), ("mocap", "pz"), ("battery", "vbat")}
    assert any("x [m]: or px [m], which have other values" in q for q in draft.questions)


@pytest.mark.parametrize("factor", [1.0, 1000.0])
def test_a_column_once_more_or_in_another_unit_is_none(tmp_path, factor):
    t, p, *_ = flown()
    unit = "m" if factor == 1.0 else "mm"
    again = vector((f"px [{unit}]", f"py [{unit}]", f"pz [{unit}]"), factor * p)
    _, draft = read(written(tmp_path, {"t": t, **vector(("x [m]", "y [m]", "z [m]"), p), **again}))
    assert draft.mapped["mocap", "px"] == ("x [m]", "m")
    assert draft.questions == ()


@pytest.mark.parametrize(("peak", "asked"), [(3000.0, True), (50.0, False)])
def test_a_gyro_beyond_degrees_may_be_counts(tmp_path, peak, asked):
    """Counts of 16.4 per deg/s were read as mrad/s, which differ by 6 %."""
    t, *_, w = flown()
    columns = {"t": t, "vbat": 4.0 - 0.01 * t, **vector(("gx", "gy", "gz"), w * peak / np.abs(w).max())}
    draft = draft_columns(written(tmp_path, columns))
    assert any("counts of the sensor" in q for q in draft.questions) == asked
    assert (("imu", "gyro_x") in draft.mapped) != asked


def test_german_and_french_names_feet_and_parts_of_a_quaternion(tmp_path):
    t, p, v, _, turn, w = flown()
    angles = np.degrees(turn.as_euler("ZYX")[:, ::-1])
    german, _ = read(written(tmp_path, {
        "Zeit [s]": t, **vector(("Position_x [mm]", "Position_y [mm]", "Position_z [mm]"), 1000.0 * p),
        **vector(("Rollwinkel [deg]", "Nickwinkel [deg]", "Gierwinkel [deg]"), angles),
        **vector(("Drehrate_x [deg/s]", "Drehrate_y [deg/s]", "Drehrate_z [deg/s]"), np.degrees(w)),
        "Batteriespannung [mV]": 4000.0 - t}, "german.csv"))
    np.testing.assert_allclose(german["imu"].values, w, atol=1e-7)
    np.testing.assert_allclose(german["attitude"]["roll", "pitch", "yaw"], np.radians(angles), atol=1e-7)
    assert german["battery"]["vbat"][0] == pytest.approx(4.0)
    french, _ = read(written(tmp_path, {
        "temps (s)": t, **vector(("x_ft", "y_ft", "z_ft"), p / 0.3048),
        **vector(("vitesse_x (m/s)", "vitesse_y (m/s)", "vitesse_z (m/s)"), v),
        **vector(("q_i", "q_j", "q_k", "q_real"), turn.as_quat()), "tension (V)": 4.0 - 0.001 * t}, "french.csv"))
    np.testing.assert_allclose(french["mocap"]["px", "py", "pz"], p, atol=1e-7)
    np.testing.assert_allclose(french["mocap"]["vx", "vy", "vz"], v, atol=1e-7)
    np.testing.assert_allclose(french["mocap"]["qx", "qy", "qz", "qw"], turn.as_quat(), atol=1e-7)
    assert french["battery"]["vbat"][0] == pytest.approx(4.0)


def test_a_height_next_to_x_and_y_and_wanted_axes_in_one_word(tmp_path):
    t, p, *_ = flown()
    wanted = p + 0.1
    flight, _ = read(written(tmp_path, {"horodatage": t, "x": p[:, 0], "y": p[:, 1], "altitude": p[:, 2],
                                        **vector(("xdes", "ydes", "zdes"), wanted)}))
    np.testing.assert_allclose(flight["mocap"]["pz"], p[:, 2], atol=1e-6)
    np.testing.assert_allclose(flight["setpoint"]["x", "y", "z"], wanted, atol=1e-6)


def test_a_height_of_no_vector_and_letters_of_several_meanings_are_left_out_with_a_reason(tmp_path):
    t, p, *_ = flown()
    _, draft = read(written(tmp_path, {"t": t, "altitude": 488.0 + p[:, 2], **vector(("x_d", "y_d", "z_d"), p),
                                       "compass_heading": 90.0 + 0.0 * t, "rx": 0.1 * t, "vbat": 4.0 - 0.01 * t}))
    assert set(draft.mapped) == {("", "time"), ("battery", "vbat")}
    assert "derivative" in draft.unknown["x_d"]
    assert "clockwise" in draft.unknown["compass_heading"]
    assert "rotation vector" in draft.unknown["rx"]


def test_dshot_frames_and_speeds_of_rotors_with_a_unit(tmp_path):
    t = flown()[0]
    shares = 0.5 + 0.4 * np.sin(np.outer(t, np.arange(1.0, 5.0)))
    frames = np.round(48.0 + 1999.0 * shares)
    flight, _ = read(written(tmp_path, {"t": t, **vector([f"dshot_{k}" for k in range(1, 5)], frames),
                                        **vector([f"omega{k}_rpm" for k in range(1, 5)], 20000.0 * shares)}))
    np.testing.assert_allclose(flight["motor"].values, shares, atol=0.5 / 1999.0 + 1e-9)
    np.testing.assert_allclose(flight["rpm"].values, 20000.0 * shares * np.pi / 30.0, rtol=1e-6)
    with pytest.raises(InputError, match="dshot"):  # without the word they may be counts of 11 bits
        draft_columns(written(tmp_path, {"t": t, **vector([f"motor{k}" for k in range(1, 5)], frames)}))


def test_speeds_in_miles_an_hour(tmp_path):
    t, p, v, *_ = flown()
    names = [f"v{a} [mph]" for a in "xyz"]
    flight, _ = read(written(tmp_path, {"t": t, **vector(("px", "py", "pz"), p), **vector(names, v / 0.44704)}))
    np.testing.assert_allclose(flight["mocap"]["vx", "vy", "vz"], v, atol=1e-4)


def test_the_index_of_pandas_is_the_time_where_it_holds_dates(tmp_path):
    t, p, *_ = flown()
    stamps = [str(np.datetime64("2026-03-01T10:00:00", "ns") + np.timedelta64(round(1e9 * s), "ns")) for s in t]
    flight, _ = read(written(tmp_path, {"": stamps, **vector(("px", "py", "pz"), p)}))
    np.testing.assert_allclose(flight["mocap"].time_s, t, atol=2e-6)


@pytest.mark.parametrize(("time", "place", "speed", "angles"), [
    ("tiempo (s)", "posición_{}", "velocidad_{}", ("alabeo", "cabeceo", "guiñada")),
    ("tempo", "posizione_{}", "velocità_{}", ("rollio", "beccheggio", "imbardata")),
    ("Zeit [s]", "{}_ist", "Geschwindigkeit_{}", ("Rollwinkel", "Nickwinkel", "Gierwinkel"))])
def test_names_in_other_languages(tmp_path, time, place, speed, angles):
    t, p, v, _, turn, w = flown()
    euler = turn.as_euler("ZYX")[:, ::-1]
    flight, _ = read(written(tmp_path, {
        time: t, **vector([place.format(a) for a in "xyz"], p), **vector([speed.format(a) for a in "xyz"], v),
        **vector(angles, euler), **vector(("gyro_x", "gyro_y", "gyro_z"), w)}))
    np.testing.assert_allclose(flight["mocap"]["px", "py", "pz"], p, atol=1e-8)
    np.testing.assert_allclose(flight["mocap"]["vx", "vy", "vz"], v, atol=1e-8)
    np.testing.assert_allclose(flight["attitude"]["roll", "pitch", "yaw"], euler, atol=1e-8)


@pytest.mark.parametrize(("wanted", "measured"), [
    ("{}_soll", "{}_ist"), ("{}_consigne", "{}_mesure"), ("{}_consigna", "{}_medida"), ("{}Soll", "{}Ist")])
def test_set_points_in_other_languages_are_no_truth(tmp_path, wanted, measured):
    t, p, *_ = flown()
    flight, _ = read(written(tmp_path, {"t": t, **vector([wanted.format(a) for a in "xyz"], p + 0.01),
                                        **vector([measured.format(a) for a in "xyz"], p)}))
    np.testing.assert_allclose(flight["setpoint"]["x", "y", "z"], p + 0.01, atol=1e-8)
    np.testing.assert_allclose(flight["mocap"]["px", "py", "pz"], p, atol=1e-8)


@pytest.mark.parametrize("height", ["Höhe", "hoehe", "hauteur", "altura", "altezza"])
def test_heights_in_other_languages(tmp_path, height):
    t, p, *_ = flown()
    flight, _ = read(written(tmp_path, {"t": t, "x": p[:, 0], "y": p[:, 1], height: p[:, 2]}))
    np.testing.assert_allclose(flight["mocap"]["px", "py", "pz"], p, atol=1e-8)


@pytest.mark.parametrize("axes", ["xyzw", "wxyz"])
def test_a_rotation_of_four_columns_is_a_quaternion_and_its_rate_a_gyro(tmp_path, axes):
    t, p, _, _, turn, w = flown()
    q = turn.as_quat()
    flight, _ = read(written(tmp_path, {
        "t": t, **vector(("px", "py", "pz"), p), **{f"cf_Rotation_{a.upper()}": q[:, "xyzw".index(a)] for a in axes},
        **vector(("rotation_rate_x", "rotation_rate_y", "rotation_rate_z"), w)}))
    np.testing.assert_allclose(flight["mocap"]["qx", "qy", "qz", "qw"], q, atol=1e-8)
    np.testing.assert_allclose(flight["imu"]["gyro_x", "gyro_y", "gyro_z"], w, atol=1e-8)


def test_a_rotation_of_three_columns_is_no_quaternion(tmp_path):
    t, p, _, _, turn, _ = flown()
    draft = draft_columns(written(tmp_path, {"t": t, **vector(("px", "py", "pz"), p),
                                             **vector(("Rotation_X", "Rotation_Y", "Rotation_Z"), turn.as_rotvec())}))
    assert not any(name.startswith(("q", "gyro", "roll")) for _, name in draft.mapped)
