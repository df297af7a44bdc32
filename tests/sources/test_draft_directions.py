"""Column names that state directions: north, east, down; and the body rates p, q, r."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_draft_axes import G, flown

from nanobench_tools.signals.column_draft import draft_columns
from nanobench_tools.sources import load_recordings
from nanobench_tools.sources.column_names import directed

DOWN = np.array([1.0, -1.0, -1.0])
EULER = ("roll", "pitch", "yaw")
TO_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


@pytest.mark.parametrize("names", [("north", "east", "down"), ("pos_n", "pos_e", "pos_d"), ("pn", "pe", "pd")])
@pytest.mark.parametrize("body", ["FRD", "FLU"])
def test_north_east_down_is_turned(tmp_path, names, body):
    t, p, _, a, turn, w = flown()
    sides = DOWN if body == "FRD" else np.ones(3)
    q = type(turn).from_matrix(TO_NED @ turn.as_matrix() @ np.diag(sides)).as_quat()
    table = {"time_ms": 1e3 * t, **dict(zip(names, (p @ TO_NED.T).T, strict=True)),
             **{f"q{axis}": q[:, i] for axis, i in zip("wxyz", (3, 0, 1, 2), strict=True)},
             **{f"a{axis}": c for axis, c in zip("xyz", (sides * turn.inv().apply(a + G)).T, strict=True)},
             **dict(zip("pqr", np.rad2deg(sides * w).T, strict=True))}
    rows = [",".join(table), *(",".join(f"{c:.7g}" for c in row) for row in zip(*table.values(), strict=True))]
    (tmp_path / "flight.csv").write_text("\n".join(rows) + "\n")
    draft = draft_columns(tmp_path / "flight.csv")
    assert draft.questions == ()
    assert draft.mapped["imu", "gyro_y"] == ("q", "deg/s")
    (tmp_path / "map.toml").write_text(draft.text)
    flight = load_recordings([tmp_path / "flight.csv"], columns=tmp_path / "map.toml", cache=False).flights[0]
    np.testing.assert_allclose(flight["mocap"]["px", "py", "pz"], p, atol=1e-4)
    np.testing.assert_allclose(flight["imu"]["acc_x", "acc_y", "acc_z"], turn.inv().apply(a + G), atol=1e-3)
    np.testing.assert_allclose(flight["imu"]["gyro_x", "gyro_y", "gyro_z"], w, atol=1e-3)
    read = type(turn).from_quat(flight["mocap"]["qx", "qy", "qz", "qw"])
    assert (read.inv() * turn).magnitude().max() < 1e-3


def test_only_whole_sets_of_directions_are_read():
    assert directed(["north", "east", "height"]) == {}
    assert directed(["e", "n", "u"])["n"] == ("y", "ENU")
    assert directed(["v_north", "v_west", "v_up"])["v_west"] == ("v_y", "NWU")
    assert directed(["p", "q"]) == {}


@pytest.mark.parametrize("as_position", [True, False])
def test_a_velocity_in_other_axes_than_its_position_is_a_question(tmp_path, as_position):
    t, p, v, *_ = flown()
    table = np.column_stack([t, p @ TO_NED.T, v @ TO_NED.T if as_position else v])
    np.savetxt(tmp_path / "f.csv", table, delimiter=",", header="t,north,east,down,vx,vy,vz", comments="", fmt="%.6g")
    draft = draft_columns(tmp_path / "f.csv")
    assert (("mocap", "vx") in draft.mapped) == as_position
    assert bool(draft.questions) != as_position


@pytest.mark.parametrize("name", ["TimeUS", "timeus", "timestamp_us"])
def test_the_unit_of_a_time_may_be_glued_to_its_name(tmp_path, name):
    t, p, *_ = flown()
    np.savetxt(tmp_path / "f.csv", np.column_stack([1e6 * t, p, 40.0 + 0.0 * t]), delimiter=",",
               header=f"{name},PN,PE,PD,T", comments="", fmt="%.6g")
    draft = draft_columns(tmp_path / "f.csv")
    assert draft.mapped["", "time"] == (name, "us")
    assert draft.mapped[("estimator", "z") if name == "TimeUS" else ("mocap", "pz")][0] == "PD"  # ArduPilot's filter


@pytest.mark.parametrize(("wanted", "unit", "status"), [
    (lambda yaw: np.degrees(yaw) % 360.0, "deg", "shown"), (lambda yaw: yaw, "rad", "shown"),
    (lambda yaw: 0.0 * yaw + 0.3, "rad", "assumed"), (lambda yaw: np.degrees(yaw) + 90.0, "rad", "assumed")],
    ids=["degrees from 0 to 360", "radians", "constant", "another heading"])
def test_the_attitude_shows_the_unit_of_a_yaw_set_point(tmp_path, wanted, unit, status):
    t, *_, turn, _ = flown()
    yaw, pitch, roll = turn.as_euler("ZYX").T
    late = np.interp(t + 0.1, t, yaw)
    np.savetxt(tmp_path / "f.csv", np.column_stack([1e6 * t, *np.degrees([roll, pitch, yaw]), wanted(late)]),
               delimiter=",", header="time_us,Roll,Pitch,Yaw,DesYaw", comments="", fmt="%.6g")
    draft = draft_columns(tmp_path / "f.csv")
    assert draft.mapped["setpoint", "yaw"] == ("DesYaw", unit)
    assert draft.status["DesYaw"] == status


EAST_UP_SOUTH = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


@pytest.mark.parametrize("streams", ["poses", "poses and imu", "positions"])
@pytest.mark.parametrize(("world", "frame"), [(TO_NED, "NED"), (EAST_UP_SOUTH, "EUS")])
def test_axes_that_no_name_states_are_shown_by_the_flight(tmp_path, world, frame, streams):
    """The draft turns the poses, and the IMU with them: what is read is the flight as it was."""
    t, p, _, a, turn, w = flown()
    body = DOWN if frame == "NED" else np.ones(3)
    side = np.diag(body) if frame == "NED" else world
    q = type(turn).from_matrix(world @ turn.as_matrix() @ side.T).as_quat()
    table = {"t": t, **dict(zip("xyz", (p @ world.T).T, strict=True))}
    if streams != "positions":
        table |= {f"q{axis}": q[:, i] for i, axis in enumerate("xyzw")}
    if streams == "poses and imu":
        table |= {f"acc_{axis}": c for axis, c in zip("xyz", (body * turn.inv().apply(a + G)).T, strict=True)}
        table |= {f"gyro_{axis}": c for axis, c in zip("xyz", (body * w).T, strict=True)}
    rows = [",".join(table), *(",".join(f"{c:.7g}" for c in row) for row in zip(*table.values(), strict=True))]
    (tmp_path / "flight.csv").write_text("\n".join(rows) + "\n")
    draft = draft_columns(tmp_path / "flight.csv")
    assert any("left-handed" in note for note in draft.notes) == (frame == "EUS" and "imu" not in streams)
    (tmp_path / "map.toml").write_text(draft.text)
    (flight,) = load_recordings([tmp_path / "flight.csv"], columns=tmp_path / "map.toml", cache=False).flights
    np.testing.assert_allclose(flight["mocap"]["px", "py", "pz"], p, atol=1e-5)
    if streams == "poses and imu":
        np.testing.assert_allclose(flight["imu"]["gyro_x", "gyro_y", "gyro_z"], w, atol=1e-5)


def test_the_advice_for_a_left_handed_world_gives_the_flight_as_it_was(tmp_path):
    """Unity: x to the right, y up, z ahead. A mirror leaves the components of a quaternion along its plane's normal."""
    t, p, *_, turn, _ = flown()
    ahead = EAST_UP_SOUTH * [[1.0], [1.0], [-1.0]]
    q = type(turn).from_matrix(ahead @ turn.as_matrix() @ ahead.T).as_quat()
    table = {"t": t, **dict(zip("xyz", (p @ ahead.T).T, strict=True)),
             **{f"q{axis}": q[:, i] for i, axis in enumerate("xyzw")}}
    rows = [",".join(table), *(",".join(f"{c:.7g}" for c in row) for row in zip(*table.values(), strict=True))]
    (tmp_path / "flight.csv").write_text("\n".join(rows) + "\n")
    draft = draft_columns(tmp_path / "flight.csv")
    assert any("negate z with qx and qy there" in note for note in draft.notes)
    text = draft.text
    for name in ("z", "qx", "qy"):
        text = text.replace(f'column = "{name}",', f'column = "{name}", sign = -1,')
    (tmp_path / "map.toml").write_text(text)
    (flight,) = load_recordings([tmp_path / "flight.csv"], columns=tmp_path / "map.toml", cache=False).flights
    mocap = flight["mocap"]
    np.testing.assert_allclose(mocap["px", "py", "pz"], p, atol=1e-5)
    read = type(turn).from_quat(mocap["qx", "qy", "qz", "qw"])
    np.testing.assert_allclose((read.inv() * turn).magnitude(), 0.0, atol=1e-5)


def steep():
    """``flown``, twice as wide and as fast: leaning by 40 degrees in most rows, at rest on the ground at both ends."""
    step = 0.01
    t = np.arange(0.0, 16.0, step)
    ramp = np.clip((t - 2.0) / 3.0, 0.0, 1.0) * np.clip((14.0 - t) / 3.0, 0.0, 1.0)
    ramp = ramp * ramp * (3.0 - 2.0 * ramp)
    p = np.stack([2.0 * ramp * np.sin(2.0 * t), 2.0 * ramp * np.cos(2.0 * t), ramp], axis=1)
    a = np.gradient(np.gradient(p, step, axis=0), step, axis=0)
    up = (a + G) / np.linalg.norm(a + G, axis=1, keepdims=True)
    left = np.cross(up, [1.0, 0.0, 0.0])
    left /= np.linalg.norm(left, axis=1, keepdims=True)
    turn = Rotation.from_matrix(np.stack([np.cross(left, up), left, up], axis=2))
    w = np.vstack([(turn[:-1].inv() * turn[1:]).as_rotvec() / step, np.zeros(3)])
    noise = 3e-4 * np.random.default_rng(7).standard_normal(p.shape)
    return t, p + noise, np.gradient(p, step, axis=0), a, turn, w


@pytest.mark.parametrize("path", [flown, steep])
@pytest.mark.parametrize("plain", [True, False], ids=["plain names", "names of poses"])
def test_a_table_in_ned_and_frd_as_a_whole_is_turned_as_a_whole(tmp_path, path, plain):
    """Plain x, y, z and their velocity are like PX4's; Euler angles and IMU beside them are in its axes, too."""
    t, p, v, a, turn, w = path()
    of = Rotation.from_matrix(TO_NED @ turn.as_matrix() @ np.diag(DOWN))
    turned = dict(zip(("roll", "pitch", "yaw"), of.as_euler("ZYX", degrees=True)[:, ::-1].T, strict=True)) if plain \
        else dict(zip(("qx", "qy", "qz", "qw"), of.as_quat().T, strict=True))
    table = {"timestamp": t, **dict(zip(("x", "y", "z") if plain else ("px", "py", "pz"), (p @ TO_NED.T).T,
                                        strict=True)), **turned}
    if plain:
        table |= {f"v{axis}": c for axis, c in zip("xyz", (v @ TO_NED.T).T, strict=True)}
    table |= {f"acc_{axis}": c for axis, c in zip("xyz", (DOWN * turn.inv().apply(a + G)).T, strict=True)}
    table |= {f"gyro_{axis}": c for axis, c in zip("xyz", (DOWN * w).T, strict=True)}
    rows = [",".join(table), *(",".join(f"{c:.7g}" for c in row) for row in zip(*table.values(), strict=True))]
    (tmp_path / "flight.csv").write_text("\n".join(rows) + "\n")
    draft = draft_columns(tmp_path / "flight.csv")
    assert not any("nose" in note for note in draft.notes)
    (tmp_path / "map.toml").write_text(draft.text)
    (flight,) = load_recordings([tmp_path / "flight.csv"], columns=tmp_path / "map.toml", cache=False).flights
    place, names = ("estimator", ("x", "y", "z")) if plain else ("mocap", ("px", "py", "pz"))
    read = Rotation.from_euler("ZYX", flight["attitude"]["yaw", "pitch", "roll"]) if plain else \
        Rotation.from_quat(flight["mocap"]["qx", "qy", "qz", "qw"])
    np.testing.assert_allclose(flight[place][names], p, atol=1e-4)
    np.testing.assert_allclose(flight["imu"]["acc_x", "acc_y", "acc_z"], turn.inv().apply(a + G), atol=1e-3)
    np.testing.assert_allclose(flight["imu"]["gyro_x", "gyro_y", "gyro_z"], w, atol=1e-3)
    assert (read.inv() * turn).magnitude().max() < 1e-3


@pytest.mark.parametrize("inertial", [False, True], ids=["angles alone", "with an IMU"])
@pytest.mark.parametrize("axes", ["NED/FRD", "ENU/FLU"])
def test_angles_beside_north_east_down_are_in_the_axes_that_the_tilt_shows(tmp_path, axes, inertial):
    t, p, _, a, turn, w = flown()
    body = DOWN if axes == "NED/FRD" else np.ones(3)
    of = Rotation.from_matrix(TO_NED @ turn.as_matrix() @ np.diag(DOWN)) if axes == "NED/FRD" else turn
    angles = of.as_euler("ZYX", degrees=True)[:, ::-1]
    table = {"t": t, **dict(zip(("north", "east", "down"), (p @ TO_NED.T).T, strict=True)),
             **dict(zip(EULER, angles.T, strict=True))}
    if inertial:
        table |= {f"acc_{axis}": c for axis, c in zip("xyz", (body * turn.inv().apply(a + G)).T, strict=True)}
        table |= {f"gyro_{axis}": c for axis, c in zip("xyz", (body * w).T, strict=True)}
    flight, draft = read(tmp_path, "flight.csv", table)
    assert draft.questions == ()
    found = Rotation.from_euler("ZYX", flight["attitude"]["yaw", "pitch", "roll"])
    assert (found.inv() * turn).magnitude().max() < 1e-3
    np.testing.assert_allclose(flight["mocap"]["px", "py", "pz"], p, atol=1e-4)
    if inertial:
        np.testing.assert_allclose(flight["imu"]["acc_x", "acc_y", "acc_z"], turn.inv().apply(a + G), atol=1e-3)
        np.testing.assert_allclose(flight["imu"]["gyro_x", "gyro_y", "gyro_z"], w, atol=1e-3)


def read(folder, name, table):
    """The flight of a table by its draft, and the draft."""
    rows = [",".join(table), *(",".join(f"{c:.9g}" for c in row) for row in zip(*table.values(), strict=True))]
    (folder / name).write_text("\n".join(rows) + "\n")
    draft = draft_columns(folder / name)
    (folder / "map.toml").write_text(draft.text)
    return load_recordings([folder / name], columns=folder / "map.toml", cache=False).flights[0], draft


def test_an_ardupilot_table_is_the_vehicles_estimate_in_its_axes(tmp_path):
    t, p, v, _, turn, _ = flown()
    of = Rotation.from_matrix(TO_NED @ turn.as_matrix() @ np.diag(DOWN))
    table = {"TimeUS": np.round(1e6 * t), **dict(zip(("Roll", "Pitch", "Yaw"),
                                                     of.as_euler("ZYX", degrees=True)[:, ::-1].T, strict=True)),
             **dict(zip(("VN", "VE", "VD"), (v @ TO_NED.T).T, strict=True)),
             **dict(zip(("PN", "PE", "PD"), (p @ TO_NED.T).T, strict=True))}
    table["Yaw"] = table["Yaw"] % 360.0
    table["DesYaw"] = (table["Yaw"] + 10.0) % 360.0
    flight, draft = read(tmp_path, "XKF1.csv", table)
    assert set(flight.streams) == {"estimator", "attitude", "setpoint"}
    apart = np.degrees(flight["attitude"]["yaw"] - flight["setpoint"]["yaw"])
    np.testing.assert_allclose((apart + 180.0) % 360.0 - 180.0, 10.0, atol=1e-3)
    np.testing.assert_allclose(flight["estimator"]["x", "y", "z"], p, atol=1e-4)
    np.testing.assert_allclose(flight["estimator"]["vx", "vy", "vz"], v, atol=1e-4)
    found = Rotation.from_euler("ZYX", flight["attitude"]["yaw", "pitch", "roll"])
    assert (found.inv() * turn).magnitude().max() < 1e-3
    assert {draft.status[c] for c in ("PN", "VD", "Pitch")} == {"known"}


def test_angles_of_that_spelling_alone_do_not_make_an_ardupilot_table(tmp_path):
    t, *_, turn, _ = flown()
    angles = turn.as_euler("ZYX", degrees=True)[:, ::-1]
    flight, draft = read(tmp_path, "a.csv", {"t": t, **dict(zip(("Roll", "Pitch", "Yaw"), angles.T, strict=True))})
    np.testing.assert_allclose(np.degrees(flight["attitude"]["pitch"]), angles[:, 1], atol=1e-3)
    assert any("nose down" in note for note in draft.notes)


@pytest.mark.parametrize(("name", "element"), [
    ("vehicle_local_position.x", "vehicle_attitude.q[1]"), ("vehicle_local_position_0_x", "vehicle_attitude_0_q[1]"),
    ("/vehicle_local_position.00/x", "/vehicle_attitude.00/q.01"),
    ("/fmu/out/vehicle_local_position/x", "/uav/fmu/out/vehicle_attitude/q[1]")])
def test_px4_topics_in_one_table_are_the_vehicles_estimate(tmp_path, name, element):
    t, p, _, _, turn, w = flown()
    of = Rotation.from_matrix(TO_NED @ turn.as_matrix() @ np.diag(DOWN)).as_quat()
    table = {"timestamp": np.round(1e6 * t),
             **{f"{name[:-1]}{axis}": c for axis, c in zip("xyz", (p @ TO_NED.T).T, strict=True)},
             **{element.replace("1", str(k)): of[:, i] for k, i in enumerate((3, 0, 1, 2))},
             **{f"sensor_combined.gyro_rad[{k}]": c for k, c in enumerate((DOWN * w).T)}}
    flight, draft = read(tmp_path, "log.csv", table)
    assert set(flight.streams) == {"estimator", "attitude_qw", "imu"}
    assert draft.questions == ()
    np.testing.assert_allclose(flight["estimator"]["x", "y", "z"], p, atol=1e-4)
    np.testing.assert_allclose(flight["imu"]["gyro_x", "gyro_y", "gyro_z"], w, atol=1e-4)
    found = Rotation.from_quat(flight["attitude_qw"]["qx", "qy", "qz", "qw"])
    assert (found.inv() * turn).magnitude().max() < 1e-3


@pytest.mark.parametrize("si", [False, True], ids=["mg and mrad/s", "SI"])
def test_mavlink_messages_are_the_vehicles_own_in_ned_and_frd(tmp_path, si):
    t, p, v, a, turn, w = flown()
    angles = Rotation.from_matrix(TO_NED @ turn.as_matrix() @ np.diag(DOWN)).as_euler("ZYX")[:, ::-1]
    table = {"time_boot_ms": np.round(1e3 * t), **dict(zip(EULER, angles.T, strict=True)),
             **dict(zip(("rollspeed", "pitchspeed", "yawspeed"), (DOWN * w).T, strict=True)),
             **dict(zip(("x", "y", "z"), (p @ TO_NED.T).T, strict=True)),
             **dict(zip(("vx", "vy", "vz"), (v @ TO_NED.T).T, strict=True))}
    flight, draft = read(tmp_path, "ATTITUDE.csv", table)
    assert draft.questions == ()
    assert set(flight.streams) == {"estimator", "attitude", "imu"}
    found = Rotation.from_euler("ZYX", flight["attitude"]["yaw", "pitch", "roll"])
    assert (found.inv() * turn).magnitude().max() < 1e-3
    np.testing.assert_allclose(flight["imu"]["gyro_x", "gyro_y", "gyro_z"], w, atol=1e-4)
    np.testing.assert_allclose(flight["estimator"]["x", "y", "z"], p, atol=1e-4)
    units = (1.0, 1.0) if si else (1000.0 / 9.81, 1000.0)
    force = DOWN * turn.inv().apply(a + G)
    table = {"time_usec": np.round(1e6 * t), **dict(zip(EULER, angles.T, strict=True)),
             **dict(zip(("xacc", "yacc", "zacc"), units[0] * force.T, strict=True)),
             **dict(zip(("xgyro", "ygyro", "zgyro"), units[1] * (DOWN * w).T, strict=True))}
    flight, draft = read(tmp_path, "IMU.csv", table)
    np.testing.assert_allclose(flight["imu"]["acc_x", "acc_y", "acc_z"], DOWN * force, atol=1e-3)
    np.testing.assert_allclose(flight["imu"]["gyro_x", "gyro_y", "gyro_z"], w, atol=1e-4)
