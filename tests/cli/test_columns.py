"""``nanobench columns``: the drafted map loads and gives the numbers back in SI; bad files are one line."""

import json

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from nanobench_tools.cli.columns import _said
from nanobench_tools.signals.column_draft import draft_columns
from nanobench_tools.signals.draft import ColumnDraft
from nanobench_tools.sources import load_recordings
from nanobench_tools.sources.column_map import read_column_map
from nanobench_tools.sources.column_names import meaning, words_of

N = 400


@pytest.fixture
def table():
    """SI values of a made-up flight by (stream, quantity); 100 Hz."""
    t = np.arange(N) / 100.0
    still = np.zeros(N)
    return {"time": 1000.0 + t, "px": np.sin(t), "py": np.cos(t), "pz": 1.0 + 0.1 * np.sin(3 * t),
            "acc_x": 0.1 * np.sin(t), "acc_y": still, "acc_z": 9.81 + 0.2 * np.cos(5 * t),
            "gyro_x": 0.3 * np.sin(2 * t), "m1": 0.5 + 0.1 * np.sin(t),
            "m2": 0.5 + 0.1 * np.cos(t), "vbat": 3.9 - 0.01 * t}


def write(path, columns, delimiter=","):
    rows = [delimiter.join(columns)]
    rows += [delimiter.join(repr(float(c[i])) for c in columns.values()) for i in range(N)]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize("delimiter", [",", ";"])
def test_the_draft_loads_and_finds_units_from_the_numbers(nanobench, tmp_path, table, delimiter):
    path = write(tmp_path / "flüge.csv", {
        "Timestamp": 1e3 * table["time"], "pos.x": table["px"], "pos.y": table["py"], "pos.z": table["pz"],
        "accX": table["acc_x"] / 9.81, "accY": table["acc_y"] / 9.81, "accZ": table["acc_z"] / 9.81,
        "gyro_x [deg/s]": np.rad2deg(table["gyro_x"]), "motor.m1": 65535 * table["m1"], "motor.m2": 65535 * table["m2"],
        "vbat_mV": 1e3 * table["vbat"], "mood": np.ones(N)}, delimiter)
    out = tmp_path / "map.toml"
    code, shown, err = nanobench("columns", path, "--out", out, "--json", tmp_path / "c.json")
    assert (code, err) == (0, "")
    assert "not guessed: mood" in shown
    assert "11 of 12 columns mapped" in shown
    assert json.loads((tmp_path / "c.json").read_text())["unknown"].keys() == {"mood"}
    (flight,) = load_recordings([path], columns=out, cache=False).flights
    for stream, quantity in (("mocap", "pz"), ("imu", "acc_z"), ("imu", "gyro_x"), ("motor", "m1"),
                             ("battery", "vbat")):
        np.testing.assert_allclose(flight[stream][quantity], table[quantity], rtol=1e-6)
    np.testing.assert_allclose(flight["imu"].time_s, table["time"] - 1000.0, atol=1e-6)
    assert nanobench("columns", path, "--out", out)[0] == 2  # never overwrites


def test_four_numbers_that_are_no_rotation_are_not_called_one(nanobench, tmp_path, table):
    turn = {"qw": np.ones(N), "qx": 0.0 * np.ones(N), "qy": 0.0 * np.ones(N), "qz": 0.0 * np.ones(N)}
    for length, known in ((1.0, True), (7.0, False)):
        path = write(tmp_path / f"{length}.csv", {"t": table["time"], "x": table["px"],
                                                  **{name: length * v for name, v in turn.items()}})
        assert nanobench("columns", path, "--out", path.with_suffix(".toml"))[0] == 0
        drafted = {e.quantity for e in read_column_map(path.with_suffix(".toml")).entries}
        assert ("qw" in drafted) is known


@pytest.mark.parametrize(("unit", "per_s"), [("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_stamps_since_1970_get_their_unit(tmp_path, table, unit, per_s):
    path = write(tmp_path / "f.csv", {"t": np.round((1.76e9 + table["time"] - 1000.0) * per_s), "x": table["px"],
                                      "y": table["py"], "z": table["pz"]})
    draft = draft_columns(path)
    assert draft.mapped["", "time"] == ("t", unit)
    assert not any("never grows" in note for note in draft.notes)


def test_the_date_shows_the_unit_of_a_time_whatever_its_name_implies(tmp_path):
    rows = [f"{1403715524907143 + 50000 * i},{0.01 * i}" for i in range(N)]
    (tmp_path / "data.csv").write_text("\n".join(["#timestamp [ns],p_RS_R_x [m]", *rows]) + "\n")
    draft = draft_columns(tmp_path / "data.csv")
    assert draft.mapped["", "time"] == ("timestamp [ns]", "us")
    assert "decades ago" in " ".join(draft.notes)


def test_a_time_of_no_date_that_is_too_long_for_a_counter_is_assumed(tmp_path):
    rows = [f"{1.54e7 + 0.02 * i:.3f},{0.3 * np.sin(0.01 * i)}" for i in range(N)]
    (tmp_path / "log.csv").write_text("\n".join(["t,gyro_x [rad/s]", *rows]) + "\n")
    assert draft_columns(tmp_path / "log.csv").status["t"] == "assumed"


def test_a_position_that_may_be_in_cm_or_mm_is_asked_about(tmp_path, table):
    path = write(tmp_path / "f.csv", {"t": table["time"], "vbat": table["vbat"],
                                      **{a: 100.0 * table[f"p{a}"] for a in "xyz"}})
    draft = draft_columns(path)
    assert ("mocap", "px") not in draft.mapped
    (question,) = draft.questions
    assert question.startswith("x, y, z: ")
    assert "cm, mm or in" in question


@pytest.mark.parametrize(("full", "unit"), [(65535, "pwm16"), (4095, None), (8191, None), (10000, None)])
def test_counts_of_a_motor_are_of_16_bits_only_where_a_vehicle_flies_with_them(tmp_path, table, full, unit):
    command = 0.6 + 0.2 * np.sin(table["time"])
    motors = {f"motor{i}": np.round(full * command) for i in range(1, 5)}
    path = write(tmp_path / "f.csv", {"t": table["time"], **motors,
                                      "x": table["px"], "y": table["py"], "z": table["pz"]})
    draft = draft_columns(path)
    assert draft.mapped.get(("motor", "m2")) == (None if unit is None else ("motor2", unit))
    assert ("the unit is unknown" in " ".join(draft.questions)) == (unit is None)


@pytest.mark.parametrize(("scale", "unit"), [(100.0, None), (1.0, "m/s"), (3000.0, "mm/s")])
def test_a_velocity_that_agrees_with_its_position_has_no_unit_of_its_own(tmp_path, table, scale, unit):
    """Agreement fixes the ratio of the two units: the velocity shares the position's question or its unit."""
    t = table["time"] - 1000.0
    speed = {"vx": np.cos(t), "vy": -np.sin(t), "vz": 0.3 * np.cos(3 * t)}
    path = write(tmp_path / "f.csv", {"t": table["time"], "vbat": table["vbat"],
                                      **{a: scale * table[f"p{a}"] for a in "xyz"},
                                      **{name: scale * v for name, v in speed.items()}})
    draft = draft_columns(path)
    assert draft.mapped.get(("mocap", "vx")) == (None if unit is None else ("vx", unit))
    assert (("mocap", "px") in draft.mapped) == (unit is not None)
    assert [q for q in draft.questions if "vx" in q and "x, y, z" in q] == list(draft.questions)


@pytest.mark.parametrize(("name", "is_what"), [
    ("stateEstimate.x", ("estimator", "x")), ("ctrltarget.yaw", ("setpoint", "yaw")), ("imu/gyro.y", ("imu", "gyro_y")),
    ("motor_3", ("motor", "m3")), ("rpm.m2", None), ("pm.vbat", ("battery", "vbat")), ("time [ms]", ("", "time")),
    ("vx", ("mocap", "vx")), ("quat_w", ("mocap", "qw")), ("x_ekf", ("estimator", "x")), ("z_vicon", ("mocap", "pz")),
    ("yaw_ref", ("setpoint", "yaw")), ("gx", ("imu", "gyro_x")), ("q0", ("mocap", "q0")), ("q_3", ("mocap", "q3")),
    ("m0", ("motor", "m0")), ("stateEstimate.ax", ("estimator_acc", "ax")), ("ekf", None), ("colour", None), ("", None),
    ("ang_vel_x", ("imu", "gyro_x")), ("ang_acc_x", None), ("b_w_x", None), ("wind_x", None), ("rpm1", ("rpm", "m1")),
    ("time_boot_ms", ("", "time")), ("time_usec", ("", "time")), ("true_x", ("mocap", "px")),
    ("goal_z", ("setpoint", "z")), ("x_demanded", ("setpoint", "x")), ("goal_qw", None)])
def test_meanings_of_names(name, is_what):
    found = meaning(name)
    if name == "rpm.m2":
        is_what = ("rpm", "m2")
    assert found == is_what or (is_what is None and isinstance(found, str))


def test_units_in_names():
    assert words_of("acc_x_m_s2") == (["acc", "x"], "m/s^2")
    assert words_of("gyro.z (dps)")[1] == "deg/s"
    assert words_of("time_usec") == (["time"], "us")


@pytest.mark.parametrize(("content", "says"), [
    (b"", "empty"), (b"\x00\x01\x02" * 50, "no table"), (b"a,b\n1,2\n", "no column is named like a time"),
    (b"t,mood\n1,2\n2,3\n", "no column except 't'"), (b"t,x\n", "no row"),
    (b"t,x\n1,2\n2,9" + b"9" * 400 + b"\n", None), (b"t,x,x\n1,2,3\n2,3,4\n", "appears twice"),
    (b"t;x\n1;2\n2;3\n", None)])
def test_bad_tables_are_one_line(nanobench, tmp_path, content, says):
    (tmp_path / "f.csv").write_bytes(content)
    code, out, err = nanobench("columns", tmp_path / "f.csv")
    if says is None:
        assert (code, err) == (0, "")
        return
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert says in err
    assert "bug" not in err


def test_a_folder_and_an_absent_file_are_one_line(nanobench, tmp_path):
    for path in (tmp_path, tmp_path / "absent.csv"):
        code, _, err = nanobench("columns", path)
        assert (code, err.count("\n")) == (2, 1)
        assert str(path) in err


def test_an_unknown_table_names_its_columns_and_this_command(nanobench, tmp_path, table):
    path = write(tmp_path / "f.csv", {"when": table["time"], "height": table["pz"]})
    code, _, err = nanobench("audit", path, "--quiet", "--jobs", 1)
    assert code == 2
    assert "when, height" in err
    assert "nanobench columns FILE" in err


def test_a_wrong_time_column_is_named_by_its_own_word(nanobench, tmp_path, table):
    path = write(tmp_path / "f.csv", {"when": table["time"], "height": table["px"]})
    (tmp_path / "m.toml").write_text('schema = "nanobench-columns/1"\ntime = "height"\n[streams.mocap]\npx = "when"\n')
    code, _, err = nanobench("audit", path, "--columns", tmp_path / "m.toml", "--quiet", "--jobs", 1)
    assert code == 2
    assert "column height: is no time" in err
    assert "m.toml" in err


def test_turned_axes_are_on_the_screen():
    notes = [f"column {k}: m, since it is so" for k in range(6)] + ["imu: forward, right, down (FRD), since gravity"]
    assert _said(ColumnDraft("", {}, {}, tuple(notes)))[0].startswith("imu: forward")


def test_near_names_are_offered(nanobench, tmp_path):
    path = tmp_path / "m.toml"
    path.write_text('schema = "nanobench-columns/1"\ntime = "t"\n[streams.imu]\nacc_xx = "a"\n')
    assert "did you mean 'acc_x'?" in nanobench("audit", tmp_path, "--columns", path)[2]
    assert "did you mean 'drag_ekf'?" in nanobench("estimate", tmp_path, "--method", "darg_ekf")[2]


def test_sources_are_listed(nanobench, tmp_path):
    code, shown, _ = nanobench("sources", "--json", tmp_path / "s.json")
    assert code == 0
    assert "nanobench columns FILE" in shown
    found = {entry["source"] for entry in json.loads((tmp_path / "s.json").read_text())["sources"]}
    assert {"nanobench", "usd", "stand", "tum", "ulog", "rosbag", "table"} <= found


@settings(max_examples=12, deadline=None, suppress_health_check=list(HealthCheck))
@given(stated=st.sets(st.sampled_from(["px", "py", "pz", "gyro_x", "gyro_y", "gyro_z"])))
def test_a_unit_that_nothing_shows_is_said_to_be_assumed(tmp_path_factory, stated):
    """A gyro in rad/s or deg/s, a position in m or mm: without a name or a number that says it, no draft claims it."""
    t = np.arange(N) / 100.0
    units = {"p": " [m]", "g": " [rad/s]"}
    columns = {"t": t}
    for name in ("px", "py", "pz", "gyro_x", "gyro_y", "gyro_z"):
        columns[name + units[name[0]] * (name in stated)] = 0.2 * np.sin(t)
    path = write(tmp_path_factory.mktemp("drafts") / "log.csv", columns)
    draft = draft_columns(path)
    said = " ".join(draft.notes)
    for (stream, _), (column, _) in draft.mapped.items():
        if stream:
            assert (column in said.split("no unit is stated for ")[-1].partition(":")[0].split(", ")) is (
                "[" not in column), (column, said)


@pytest.mark.parametrize(("unit", "per_s"), [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_the_unit_of_time_follows_from_its_steps(tmp_path, table, unit, per_s):
    draft = draft_columns(write(tmp_path / "log.csv", {"t": per_s * (table["time"] - 1000.0), "px": table["px"]}))
    assert draft.mapped["", "time"] == ("t", unit)


def test_a_quaternion_by_number_that_is_upright_in_both_orders_is_not_guessed(tmp_path, table):
    """Half a turn about z with the scalar first, no turn with the scalar last."""
    turn = {f"q{i}": np.full(N, float(i == 3)) for i in range(4)}
    draft = draft_columns(write(tmp_path / "log.csv", {"t": table["time"], "px": table["px"], **turn}))
    assert set(turn) <= set(draft.unknown)


@pytest.mark.parametrize(("scalar", "turned"), [(0, 0.4), (3, 1.5)])
def test_a_quaternion_by_number_is_the_one_with_which_the_vehicle_is_upright(tmp_path, table, scalar, turned):
    half = turned * np.sin(table["time"])
    parts = [np.cos(half), 0.05 * np.sin(half), np.zeros(N), np.sin(half)]
    parts = parts if scalar == 0 else [*parts[1:], parts[0]]
    draft = draft_columns(write(tmp_path / "q.csv", {"t": table["time"], "x": table["px"],
                                                     **{f"q{i}": part for i, part in enumerate(parts)}}))
    assert draft.mapped["mocap", "qw"] == (f"q{scalar}", "1")
    assert draft.mapped["mocap", "qz"] == ("q3" if scalar == 0 else "q2", "1")
    assert any(f"q{scalar}: the scalar" in note for note in draft.notes)


def test_dates_are_times_and_other_text_is_none(tmp_path, nanobench):
    path = tmp_path / "dates.csv"
    path.write_text("datetime,x\n" + "".join(f"2026-01-01T00:00:{i:02d}Z,{0.1 * i}\n" for i in range(30)))
    assert draft_columns(path).mapped["", "time"] == ("datetime", "iso8601")
    path.write_text("datetime,x\n" + "".join(f"monday {i},{0.1 * i}\n" for i in range(30)))
    code, _, err = nanobench("columns", path)
    assert code == 2
    assert "of text: 'datetime'" in err


@pytest.mark.parametrize(("name", "columns", "key", "sign", "frame"), [
    ("log", ("stateEstimate_x", "stateEstimate_pitch"), ("attitude", "pitch"), "sign = -1", ""),
    ("log", ("stateEstimate/x", "stateEstimate/pitch"), ("attitude", "pitch"), "sign = -1", ""),
    ("log_sensor_gyro_0", ("timestamp", "x", "y", "z", "temperature", "samples"), ("imu", "gyro_x"), "", "FRD"),
    ("log_vehicle_attitude_groundtruth_0", ("timestamp", "q[0]", "q[1]", "q[2]", "q[3]"), ("mocap", "qw"), "",
     "NED/FRD")])
def test_names_of_an_ecosystem_in_other_spellings_and_topics(tmp_path, name, columns, key, sign, frame):
    path = tmp_path / f"{name}.csv"
    rows = [",".join([*columns, "timestamp"] if "timestamp" not in columns else columns)]
    rows += [",".join(str(10_000 * i) if c == "timestamp" else "0.5" for c in rows[0].split(",")) for i in range(50)]
    path.write_text("\n".join(rows) + "\n")
    draft = draft_columns(path)
    assert key in draft.mapped
    assert sign in draft.text
    assert not frame or f'frame = "{frame}"' in draft.text


def test_a_reading_that_means_none_is_missing_and_not_65535(tmp_path):
    rows = ["timestamp,motor.m1_rpm,motor.m2_rpm,pm.vbat",
            *(f"{10 * i},{65535 if i < 5 else 12000 + i},{12000 + i},3.9" for i in range(60))]
    (tmp_path / "log.csv").write_text("\n".join(rows) + "\n")
    draft = draft_columns(tmp_path / "log.csv")
    (tmp_path / "map.toml").write_text(draft.text)
    (flight,) = load_recordings([tmp_path / "log.csv"], columns=tmp_path / "map.toml", cache=False).flights
    speed = flight["rpm"]["m1"]
    assert np.isnan(speed[:5]).all()
    np.testing.assert_allclose(speed[5:] * 60.0 / (2.0 * np.pi), 12000.0 + np.arange(5, 60))
    assert np.isfinite(flight["rpm"]["m2"]).all()


def test_a_time_that_fits_two_units_is_assumed_and_every_audit_repeats_it(tmp_path):
    """Rows 1 apart: one a second, or one a millisecond."""
    rows = [f"{i},{0.3 * np.sin(0.01 * i)}" for i in range(N)]
    (tmp_path / "log.csv").write_text("\n".join(["t,gyro_x [rad/s]", *rows]) + "\n")
    draft = draft_columns(tmp_path / "log.csv")
    assert draft.status["t"] == "assumed"
    assert "rows are 1 apart, in s or ms: s is assumed; check it" in " ".join(draft.notes)
    (tmp_path / "map.toml").write_text(draft.text)
    (flight,) = load_recordings([tmp_path / "log.csv"], columns=tmp_path / "map.toml", cache=False).flights
    assert [(a.column, a.unit) for a in flight.provenance.assumptions] == [("t", "s")]


def test_seconds_and_their_fraction_in_two_columns_are_one_time(tmp_path, table):
    rows = np.arange(N)
    path = write(tmp_path / "rostopic.csv", {"header.stamp.secs": 1000.0 + rows // 100,
                                             "header.stamp.nsecs": 1e7 * (rows % 100), "x": table["px"]})
    (tmp_path / "map.toml").write_text(draft_columns(path).text)
    (flight,) = load_recordings([path], columns=tmp_path / "map.toml", cache=False).flights
    np.testing.assert_allclose(flight["mocap"].time_s, rows / 100.0, atol=1e-6)


def test_two_vehicles_in_one_table_are_a_question(tmp_path, table):
    path = write(tmp_path / "two.csv", {"t": table["time"], "cf1.x": table["px"], "cf2.x": table["px"] + 2.0,
                                        "gyro_x": table["gyro_x"]})
    draft = draft_columns(path)
    assert any("cf1, cf2" in question for question in draft.questions)
    assert ("mocap", "px") not in draft.mapped


def test_nine_numbers_are_a_matrix_and_no_quaternion(tmp_path, table):
    matrix = {f"rot[{k}]": np.full(N, float(k % 4 == 0)) for k in range(9)}
    draft = draft_columns(write(tmp_path / "m.csv", {"t": table["time"], "x": table["px"], **matrix}))
    assert "rotation matrix" in draft.unknown["rot[0]"]
    assert not any(quantity.startswith("q") for _, quantity in draft.mapped)


def test_an_export_that_needs_no_map_is_not_drafted(tmp_path, nanobench):
    rows = ["Objects", "100", ",,Global Angle cf1:cf1,,,Global Translation cf1:cf1,,",
            "Frame,Sub Frame,RX,RY,RZ,TX,TY,TZ", ",,rad,rad,rad,mm,mm,mm",
            *(f"{k},0,0,0,0,{k},0,1000" for k in range(1, N))]
    path = tmp_path / "vicon.csv"
    path.write_text("\n".join(rows) + "\n")
    code, _, err = nanobench("columns", path)
    assert code == 2
    assert "an export of Vicon, which needs no map" in err
    (flight,) = load_recordings([path], cache=False).flights
    np.testing.assert_allclose(flight["mocap"]["pz"], 1.0)


def test_marker_trajectories_are_no_body(tmp_path):
    path = tmp_path / "nexus.csv"
    path.write_text("Trajectories\n100\n,,cf1:m1,,\nFrame,Sub Frame,X,Y,Z\n,,mm,mm,mm\n" +
                    "\n".join(f"{k},0,{k},0,1000" for k in range(1, 50)) + "\n")
    (failed,) = load_recordings([path], cache=False).failed
    assert "export the object or its segments" in failed["error"]
