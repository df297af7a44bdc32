"""Tables that public bug reports led to, and their neighbours: right, or a question, never silently wrong."""

import math
from pathlib import Path

import numpy as np
import pytest

from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.errors import InputError
from nanobench_tools.signals.column_draft import draft_columns
from nanobench_tools.sources import load_recordings

REPORTS = next((p / "data/reports" for p in (Path(__file__).parents[2] / "../shared",) if p.exists()), None)


@pytest.fixture
def reports():
    if REPORTS is None or not REPORTS.is_dir():
        pytest.skip("REPORTED TABLES ABSENT: no folder data/reports beside the recordings")
    return REPORTS


def read(path, tmp_path):
    out = tmp_path / "map.toml"
    out.write_text(draft_columns(path).text, encoding="utf-8")
    loaded = load_recordings([path], columns=out, cache=False)
    assert loaded.failed == []
    return loaded.flights[0]


def test_the_gyro_of_a_crazyflie_is_in_degrees(reports, tmp_path):
    flight = read(reports / "cfclient_gyro_deg/log.csv", tmp_path)
    raw = np.genfromtxt(reports / "cfclient_gyro_deg/log.csv", delimiter=",", names=True, deletechars="")
    np.testing.assert_allclose(flight["imu"]["gyro_y"], raw["gyro.y"] * math.pi / 180)
    np.testing.assert_allclose(flight["attitude"]["pitch"], -raw["stabilizer.pitch"] * math.pi / 180)


def test_compressed_estimates_are_in_millimetres(reports, tmp_path):
    flight = read(reports / "cfclient_stateEstimateZ_mm/log.csv", tmp_path)
    assert np.ptp(flight["estimator"]["z"]) == pytest.approx(1.0, abs=0.03)


def test_biases_of_euroc_are_no_imu(reports, tmp_path):
    flight = read(reports / "euroc_truth_biases_as_imu/data.csv", tmp_path)
    assert set(flight.streams) == {"mocap"}
    assert {"px", "vx", "qw"} <= set(flight["mocap"].quantities)


def test_the_local_position_of_px4_points_down(reports, tmp_path):
    source = reports / "px4_local_position_csv/log_vehicle_local_position_0.csv"
    renamed = tmp_path / "flight.csv"  # the numbers show it where the file's name does not
    renamed.write_bytes(source.read_bytes())
    for path in (source, renamed):
        flight = read(path, tmp_path)
        assert "imu" not in flight
        assert "mocap" not in flight
        assert flight["estimator"]["z"].max() == pytest.approx(1.0, abs=0.03)


def test_pulses_from_motor_0(reports, tmp_path):
    flight = read(reports / "sysid_motors_from_0_pulses/flight.csv", tmp_path)
    assert flight["motor"].columns == ("u0", "u1", "u2", "u3")
    assert np.median(flight["motor"]["m1"]) == pytest.approx(0.64, abs=0.02)


def test_an_angular_velocity_is_a_gyro(reports, tmp_path):
    flight = read(reports / "sysid_ang_vel_as_velocity/flight.csv", tmp_path)
    assert set(flight.streams) == {"imu"}
    flight = read(reports / "uzhfpv_imu_txt/imu.txt", tmp_path)
    assert flight["imu"].rate_hz == pytest.approx(500.0, rel=0.01)


@pytest.mark.parametrize("name", ["motive_export/take.csv", "qualisys_export/flight_6D.tsv"])
def test_exports_are_read_without_a_map(reports, name):
    (flight,) = load_recordings([reports / name], cache=False).flights
    mocap = flight["mocap"]
    assert np.nanmax(mocap["pz"]) == pytest.approx(1.0, abs=0.02)
    hidden = mocap.time_s[~np.isfinite(mocap["px"])]
    assert (hidden[0], hidden[-1]) == (pytest.approx(3.33, abs=0.05), pytest.approx(3.7, abs=0.05))


def test_a_stand_with_one_motor(reports):
    (flight,) = load_recordings([reports / "thrust_stand_kgf_esc_us/stand.csv"], cache=False).flights
    assert flight["motor"].quantities == ("m1",)
    assert flight["motor"]["m1"].max() == pytest.approx(1.0)
    assert flight["stand"]["thrust"].max() == pytest.approx(18.6, abs=0.4)


# --- neighbours, written here

T = np.arange(0.0, 12.0, 0.02)
UP = np.clip(T - 1.0, 0.0, 1.0) * np.clip(11.0 - T, 0.0, 1.0)


def write(path, columns, delimiter=","):
    rows = [delimiter.join(columns), *(delimiter.join(f"{c[k]:.9g}" for c in columns.values()) for k in range(len(T)))]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


def flown(scale=1.0):
    turn = 0.7 * np.sin(0.9 * (T - 1.0)) * (UP > 0.5)
    return {"t": T, "x": scale * turn, "y": scale * 0.5 * turn, "z": scale * UP}


@pytest.mark.parametrize(("battery", "is_volts"), [
    (np.linspace(4.1, 3.7, len(T)), True), (np.linspace(16.4, 14.8, len(T)), True),
    (np.linspace(4100, 3700, len(T)), True), (np.round(np.linspace(88, 71, len(T))), False),
    (np.linspace(0.96, 0.89, len(T)), False), (np.linspace(87.5, 61.2, len(T)), False)])
def test_a_battery_is_volts_or_left_out(tmp_path, battery, is_volts):
    draft = draft_columns(write(tmp_path / "f.csv", {**flown(), "battery": battery}))
    assert (("battery", "vbat") in draft.mapped) is is_volts
    if not is_volts:
        assert "percentage" in draft.unknown["battery"] or "share" in draft.unknown["battery"]


@pytest.mark.parametrize("wrong", ["x", "vx", "z", "vz"])
@pytest.mark.parametrize("factor", [1000.0, 100.0, 1e-3])
def test_a_rescaled_column_of_a_known_log_is_asked_about(tmp_path, wrong, factor):
    p = flown(1000.0)
    columns = {f"stateEstimateZ.{a}": p[a] for a in "xyz"}
    columns |= {f"stateEstimateZ.v{a}": np.gradient(p[a], T) for a in "xyz"}
    good = {"Timestamp": 1e3 * T, **columns}
    assert draft_columns(write(tmp_path / "good.csv", good)).questions == ()
    columns[f"stateEstimateZ.{wrong}"] = factor * columns[f"stateEstimateZ.{wrong}"]
    bad = {"Timestamp": 1e3 * T, "pm.vbat": 3.9 + 0.0 * T, **columns}
    draft = draft_columns(write(tmp_path / "bad.csv", bad))
    assert draft.questions
    assert f"stateEstimateZ.{wrong}" not in {column for column, _ in draft.mapped.values()}


@pytest.mark.parametrize("unit", ["rad/s", "deg/s"])
def test_a_gyro_without_a_unit_is_judged_by_the_attitude(tmp_path, unit):
    angle = 0.3 * np.sin(2.0 * T)
    rate = 0.6 * np.cos(2.0 * T) * (180 / math.pi if unit == "deg/s" else 1.0)
    columns = {**flown(), "qx": np.sin(angle / 2), "qy": 0 * T, "qz": 0 * T, "qw": np.cos(angle / 2), "gyro_x": rate,
               "gyro_y": 0 * T, "gyro_z": 0 * T}
    draft = draft_columns(write(tmp_path / "f.csv", columns))
    assert draft.mapped["imu", "gyro_x"] == ("gyro_x", unit)
    assert draft.status["gyro_x"] == "shown"


def test_three_motors_of_four_are_asked_about(tmp_path):
    columns = {**flown(), **{f"u{k}": 1000.0 + 600.0 * UP + k for k in (1, 2, 3)}}
    draft = draft_columns(write(tmp_path / "f.csv", columns))
    assert any("counted from 0 or from 1" in q for q in draft.questions)
    assert not any(stream == "motor" for stream, _ in draft.mapped)


def test_axes_of_one_vector_in_two_units_are_asked_about(tmp_path):
    rng = np.random.default_rng(2)
    columns = flown()
    for a in "xyz":
        columns[a] = columns[a] + 3e-4 * rng.normal(size=len(T))
    columns["y"] = 1e-3 * columns["y"]
    with pytest.raises(InputError, match="one unit"):
        draft_columns(write(tmp_path / "f.csv", columns))


MOTIVE = ("Format Version,1.23,Take Name,T,Capture Frame Rate,50.0,Export Frame Rate,50.0,Rotation Type,Quaternion,"
          "Length Units,{unit},Coordinate Space,Global\n\n,,{kinds}\n,,{names}\n,,{ids}\n,,{groups}\n{last}\n")


def motive(path, bodies=("cf1",), unit="Meters", scale=1.0, time=True):
    n = 7 * len(bodies)
    head = MOTIVE.format(unit=unit, kinds=",".join(["Rigid Body"] * n),
                         names=",".join(b for b in bodies for _ in range(7)), ids=",".join(["1"] * n),
                         groups=",".join((["Rotation"] * 4 + ["Position"] * 3) * len(bodies)),
                         last="Frame," + ("Time (Seconds)" if time else "Nothing") + ",X,Y,Z,W,X,Y,Z" * len(bodies))
    p = flown(scale)
    rows = [f"{k},{T[k] if time else ''}" + f",0,0,0,1,{p['x'][k]},{p['z'][k]},{-p['y'][k]}" * len(bodies)
            for k in range(len(T))]
    path.write_bytes(b"\xef\xbb\xbf" + (head + "\n".join(rows) + "\n").replace("\n", "\r\n").encode())
    return path


@pytest.mark.parametrize(("unit", "scale", "time"), [("Meters", 1.0, True), ("Millimeters", 1e3, True),
                                                     ("Centimeters", 1e2, False)])
def test_motive_in_any_length_with_time_or_frames(tmp_path, unit, scale, time):
    (flight,) = load_recordings([motive(tmp_path / "take.csv", unit=unit, scale=scale, time=time)], cache=False).flights
    p = flown()
    np.testing.assert_allclose(flight["mocap"]["px"][100:500], p["x"][100:500], atol=1e-9)
    np.testing.assert_allclose(flight["mocap"]["py"][100:500], p["y"][100:500], atol=1e-9)
    np.testing.assert_allclose(flight["mocap"]["pz"][100:500], p["z"][100:500], atol=1e-9)
    assert flight["mocap"].time_s[-1] == pytest.approx(T[-1])


@pytest.mark.parametrize(("unit", "scale", "says"), [("Millimeters", 1.0, "in mm by the header"),
                                                     ("Meters", 1000.0, "in m by the header")])
def test_a_header_with_another_unit_than_its_rows_is_refused(tmp_path, unit, scale, says):
    failed = load_recordings([motive(tmp_path / "take.csv", unit=unit, scale=scale)], cache=False).failed
    assert says in failed[0]["error"]
    assert "correct the unit in the header" in failed[0]["error"]


@pytest.mark.parametrize("noise_mm", [0.02, 0.07, 0.5])
def test_a_body_at_rest_is_no_flight_in_another_unit(tmp_path, monkeypatch, noise_mm):
    noise = np.random.default_rng(1).normal(0.0, noise_mm, (3, len(T)))
    monkeypatch.setitem(globals(), "flown", lambda scale=1.0: dict(zip("xyz", 300.0 + noise, strict=True)))
    recordings = load_recordings([motive(tmp_path / "take.csv", unit="Millimeters")], cache=False)
    assert not recordings.failed


def test_each_of_several_bodies_is_a_flight(tmp_path):
    recordings = load_recordings([motive(tmp_path / "take.csv", bodies=("cf1", "cf2"))], cache=False)
    assert [flight.name for flight in recordings.flights] == ["take.cf1", "take.cf2"]
    assert not recordings.failed


def test_vicon_tracker_with_quaternions(tmp_path):
    p = flown(1e3)
    rows = ["Objects", "50", ",,cf1:cf1,,,,,,", "Frame,Sub Frame,RX,RY,RZ,RW,TX,TY,TZ", ",,,,,,mm,mm,mm",
            *(f"{k + 1},0,0,0,0,1,{p['x'][k]},{p['y'][k]},{p['z'][k]}" for k in range(len(T)))]
    (tmp_path / "v.csv").write_text("\n".join(rows) + "\n")
    (flight,) = load_recordings([tmp_path / "v.csv"], cache=False).flights
    np.testing.assert_allclose(flight["mocap"]["pz"][100:500], 1e-3 * p["z"][100:500], atol=1e-9)
    assert np.nanmax(flight["mocap"]["qw"]) == 1.0


@pytest.mark.parametrize(("header", "u", "thrust"), [
    ("throttle (%),voltage (V),thrust (gf)", 100.0, 1e3 / 9.81), ("throttle,vbat,thrust_N", 1.0, 1.0),
    ("ESC (us),Voltage (V),Thrust (lbf)", None, 1 / 4.4482216152605), ("pwm_percent,vbat,thrust_g", 100.0, 1e3 / 9.81)])
def test_stands_in_other_units(tmp_path, header, u, thrust):
    share = np.linspace(0.0, 1.0, 30)
    command = 1000 + 1000 * share if u is None else u * share
    rows = [header, *(f"{c},{11.1},{thrust * 5.0 * s}" for c, s in zip(command, share, strict=True))]
    (tmp_path / "stand.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    (flight,) = load_recordings([tmp_path / "stand.csv"], cache=False).flights
    np.testing.assert_allclose(flight["motor"]["m1"], share, atol=1e-9)
    np.testing.assert_allclose(flight["stand"]["thrust"], 5.0 * share, rtol=1e-6)


def test_an_audit_repeats_what_was_assumed(nanobench, tmp_path):
    path = write(tmp_path / "f.csv", flown())
    assert nanobench("columns", path, "--out", tmp_path / "m.toml")[0] == 0
    code, out, _ = nanobench("audit", path, "--columns", tmp_path / "m.toml", "--jobs", 1)
    assert code == 0
    assert "assumed, not shown by name or numbers: t in s; x, y, z in m" in out


@pytest.mark.parametrize(("file", "columns", "frame", "becomes"), [
    ("log_vehicle_attitude_0.csv", [f"q[{k}]" for k in range(4)], "NED/FRD", ("attitude_qw", "qw")),
    ("log_sensor_combined_0.csv", [f"{n}[{k}]" for n in ("gyro_rad", "accelerometer_m_s2") for k in range(3)], "FRD",
     ("imu", "gyro_x")),
    ("log_vehicle_angular_velocity_0.csv", [f"xyz[{k}]" for k in range(3)], "FRD", ("imu", "gyro_x")),
    ("log_vehicle_visual_odometry_0.csv", [f"position[{k}]" for k in range(3)], "NED/FRD", ("mocap", "px"))])
def test_topics_of_px4_are_turned(tmp_path, file, columns, frame, becomes):
    values = {c: 0.3 * np.sin((k + 1) * T) for k, c in enumerate(columns)}
    if columns[0] == "q[0]":
        values = {"q[0]": np.cos(0.3 * T), "q[1]": 0 * T, "q[2]": 0 * T, "q[3]": np.sin(0.3 * T)}
    if "accelerometer_m_s2[2]" in values:
        values["accelerometer_m_s2[2]"] = values["accelerometer_m_s2[2]"] - 9.81
    path = write(tmp_path / file, {"timestamp": 5e6 + 1e6 * T, **values})
    draft = draft_columns(path)
    assert draft.mapped[becomes][0] == columns[0]
    assert f'frame = "{frame}"' in draft.text
    assert read(path, tmp_path)[becomes[0]].samples


def test_a_plain_axis_beside_an_estimate_is_asked_about(tmp_path):
    p = flown()
    columns = {"Timestamp": 1e3 * T, "stateEstimate.x": p["x"], "stateEstimate.y": p["y"], "z": p["z"]}
    draft = draft_columns(write(tmp_path / "log.csv", columns))
    assert any(q.startswith("z: ") for q in draft.questions)
    assert ("mocap", "pz") not in draft.mapped


def test_motive_with_semicolons_and_decimal_commas(tmp_path):
    text = motive(tmp_path / "take.csv").read_text(encoding="utf-8-sig").replace(",", ";").replace(".", ",")
    (tmp_path / "comma.csv").write_text(text.replace("1,23", "1.23").replace("50,0", "50.0"), encoding="utf-8")
    (flight,) = load_recordings([tmp_path / "comma.csv"], cache=False).flights
    np.testing.assert_allclose(flight["mocap"]["pz"][100:500], flown()["z"][100:500], atol=1e-9)


def test_a_flight_whose_height_is_y_is_asked_about(tmp_path):
    p = flown()
    with pytest.raises(InputError, match="is y up"):
        draft_columns(write(tmp_path / "f.csv", {"t": T, "x": p["x"], "y": p["z"], "z": p["y"]}))
    assert draft_columns(write(tmp_path / "g.csv", p)).questions == ()


def test_empty_cells_at_both_ends_are_no_trouble(tmp_path):
    path = write(tmp_path / "f.csv", flown())
    lines = path.read_text().splitlines()
    path.write_text("\n".join([lines[0], "0,,,", *lines[2:-1], "11.98,,,"]) + "\n")
    assert ("mocap", "px") in draft_columns(path).mapped


def test_one_axis_of_a_tracker_in_another_unit_is_a_fault(tmp_path):
    """The noise of one tracker is alike in all axes; with stamps that stand still it shows just as well."""
    rng = np.random.default_rng(4)
    p = flown()
    for stamps in (T, np.floor(T)):
        for axis, by in (("", 1.0), ("y", 1e-3), ("z", 57.3)):
            rows = np.stack([stamps, *((by if a == axis else 1.0) * (p[a] + 3e-4 * rng.normal(size=len(T)))
                                       for a in "xyz"), 0 * T, 0 * T, 0 * T, 1 + 0 * T], axis=1)
            np.savetxt(tmp_path / "f.tum", rows, fmt="%.9g")
            (flight,) = load_recordings([tmp_path / "f.tum"], cache=False).flights
            found = [f for f in audit(flight).faults if f.kind == "unit" and f.stream == "mocap"]
            assert bool(found) is bool(axis)
            if axis:
                assert found[0].columns == (f"t{axis}",)
                assert found[0].size == pytest.approx(by, rel=0.4)


def test_one_element_of_a_quaternion_in_another_unit_is_a_fault(tmp_path):
    p, rng = flown(), np.random.default_rng(4)
    angle = 0.2 * np.sin(2.0 * T)
    q = np.stack([np.sin(angle / 2), 0.05 * np.cos(3.0 * T), 0 * T, 0 * T], axis=1)
    q[:, 3] = np.sqrt(1.0 - (q ** 2).sum(axis=1))
    for by in (1.0, 1e-3):
        turned = np.round(q * [by, 1.0, 1.0, 1.0], 6)
        xyz = np.stack([p[a] for a in "xyz"], axis=1) + 3e-4 * rng.normal(size=(len(T), 3))
        np.savetxt(tmp_path / "f.tum", np.column_stack([T, xyz, turned]), fmt="%.9g")
        (flight,) = load_recordings([tmp_path / "f.tum"], cache=False).flights
        found = [f.columns for f in audit(flight).faults if f.kind == "unit"]
        assert found == ([] if by == 1.0 else [("qx",)])


@pytest.mark.parametrize(("scales", "words"), [
    ({"Current (A)": 57.3}, "N per W"), ({"Thrust (kgf)": 1e-3}, "N per W"), ({"Thrust (kgf)": 1e3}, "N per W"),
    ({"ESC signal (us)": 1e-3}, "in pulse_us a series reaches"), ({"ESC signal (us)": 1e3}, "in pulse_us a series")])
def test_a_stand_with_a_column_in_another_unit_is_refused(tmp_path, scales, words):
    share = np.linspace(0.0, 1.0, 30)
    columns = {"ESC signal (us)": 1000 + 1000 * share, "Thrust (kgf)": 1.9 * share, "Voltage (V)": 16.0 - share,
               "Current (A)": 24.0 * share ** 1.5}
    for changed in ({}, scales):
        rows = [",".join(columns), *(",".join(f"{changed.get(c, 1.0) * v[k]:.9g}" for c, v in columns.items())
                                     for k in range(len(share)))]
        (tmp_path / "stand.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
        loaded = load_recordings([tmp_path / "stand.csv"], cache=False)
        assert len(loaded.flights) == (not changed)
    assert words in loaded.failed[0]["error"]


def test_rotations_of_exports_that_are_none_are_refused(tmp_path):
    path = motive(tmp_path / "take.csv")
    path.write_text(path.read_text(encoding="utf-8-sig").replace(",0,0,0,1,", ",0,0,0,1000,"))
    assert "where 1 belongs" in load_recordings([path], cache=False).failed[0]["error"]
    p = flown(1e3)
    names = ["Frame", "Time", "cf1 X", "Y", "Z", "Roll", "Pitch", "Yaw"]
    for k, (change, words) in enumerate(
            [({}, ""), ({"Yaw": 2000.0}, "no angles in degrees"), ({"Z": None}, "X, Y and Z")]):
        kept = [n for n in names if change.get(n, 0.0) is not None]
        rows = ["NO_OF_FRAMES\t600", "FREQUENCY\t50", "BODY_NAMES\tcf1", "\t".join(kept), *(
            "\t".join(str(dict(zip(names, (i, T[i], p["x"][i], p["y"][i], p["z"][i], 0.0, 0.0, change.get("Yaw", 5.0)),
                                    strict=True))[n]) for n in kept) for i in range(len(T)))]
        (tmp_path / f"{k}.tsv").write_text("\n".join(rows) + "\n")
        loaded = load_recordings([tmp_path / f"{k}.tsv"], cache=False)
        assert words in (loaded.failed[0]["error"] if loaded.failed else "")
        assert bool(loaded.flights) is (not change)


TABLES = {"battery_as_percent/flight.csv": ",", "cfclient_gyro_deg/log.csv": ",",
          "cfclient_stateEstimateZ_mm/log.csv": ",", "euroc_truth_biases_as_imu/data.csv": ",",
          "px4_local_position_csv/log_vehicle_local_position_0.csv": ",", "sysid_ang_vel_as_velocity/flight.csv": ",",
          "sysid_motors_from_0_pulses/flight.csv": ",", "uzhfpv_imu_txt/imu.txt": " "}


@pytest.mark.parametrize("name", TABLES)
def test_one_column_removed_renamed_or_rescaled(reports, tmp_path, name):
    """What is still drafted is what it was; a column a thousand times larger is right, assumed or asked about."""
    lines = (reports / name).read_text().splitlines()
    mark, delimiter = "# " * lines[0].startswith("#"), TABLES[name]
    head = [h.strip() for h in lines[0].lstrip("# ").split(None if delimiter == " " else delimiter)]
    rows = [line.split(delimiter) for line in lines[1:]]

    def draft(names, cells):
        path = tmp_path / Path(name).name
        path.write_text(mark + delimiter.join(names) + "\n" + "\n".join(map(delimiter.join, cells)) + "\n")
        try:
            return draft_columns(path)
        except InputError:
            return None  # refused in one line

    whole = {column: (key, unit) for key, (column, unit) in draft(head, rows).mapped.items()}
    for k, column in enumerate(head):
        renamed = draft([*head[:k], "foo", *head[k + 1:]], rows)
        removed = draft([*head[:k], *head[k + 1:]], [[*row[:k], *row[k + 1:]] for row in rows])
        for found in filter(None, (renamed, removed)):
            assert {c: (key, unit) for key, (c, unit) in found.mapped.items()}.items() <= whole.items(), column
        if whole.get(column, (("", "time"),))[0] != ("", "time"):
            large = draft(head, [[*row[:k], repr(1000.0 * float(row[k])), *row[k + 1:]] for row in rows])
            if large is not None and not large.questions:
                kept = dict(large.mapped.values())
                assert large.status.get(column, "assumed") == "assumed" or kept[column] != whole[column][1], column
