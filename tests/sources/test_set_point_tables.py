"""Tables of set-points: never the motion capture, never the vehicle's estimate."""

from __future__ import annotations

import numpy as np
import pytest
from test_draft_axes import flown

from nanobench_tools.errors import InputError
from nanobench_tools.signals.column_draft import draft_columns
from nanobench_tools.sources import load_recordings

TO_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
XYZ = ("x", "y", "z")


def named(names, vectors):
    return dict(zip(names, vectors.T, strict=True))


def mavlink(prefix="", mask=3064, frame=1):
    t, p, v, a, *_ = flown()
    one = np.ones(len(t))
    fields = {"coordinate_frame": frame * one, "type_mask": mask * one, **named(XYZ, p @ TO_NED.T),
              **named(("vx", "vy", "vz"), v @ TO_NED.T), **named(("afx", "afy", "afz"), a @ TO_NED.T),
              "yaw": 0.5 * np.pi - 0.3 * np.sin(t), "yaw_rate": 0.0 * t}
    return t, p, {f"{prefix}{name}": cells for name, cells in fields.items()}


def written(folder, name, table):
    rows = [",".join(table), *(",".join(f"{c:.13g}" for c in row) for row in zip(*table.values(), strict=True))]
    (folder / name).write_text("\n".join(rows) + "\n")
    return folder / name


def read(folder, path):
    draft = draft_columns(path)
    assert draft.questions == ()
    (folder / "map.toml").write_text(draft.text)
    return load_recordings([path], columns=folder / "map.toml", cache=False).flights[0]


@pytest.mark.parametrize(("name", "prefix"), [
    ("a.csv", ""), ("POSITION_TARGET_LOCAL_NED.csv", ""), ("a.csv", "POSITION_TARGET_LOCAL_NED."),
    ("a.csv", "/mavlink_message/SET_POSITION_TARGET_LOCAL_NED/"), ("a.csv", "mavlink_position_target_local_ned_t.")])
def test_mavlinks_target_is_a_set_point_in_ned(tmp_path, name, prefix):
    t, p, table = mavlink(prefix)
    flight = read(tmp_path, written(tmp_path, name, {"time_boot_ms": np.round(1e3 * t), **table}))
    assert set(flight.streams) == {"setpoint"}
    np.testing.assert_allclose(flight["setpoint"][XYZ], p, atol=1e-6)
    np.testing.assert_allclose(flight["setpoint"]["yaw"], 0.3 * np.sin(t), atol=1e-6)


def test_the_name_of_the_file_is_enough(tmp_path):
    """Without the columns that only a target has."""
    t, _, table = mavlink()
    table = {"time_boot_ms": np.round(1e3 * t), **{k: table[k] for k in XYZ}}
    flight = read(tmp_path, written(tmp_path, "SET_POSITION_TARGET_LOCAL_NED.csv", table))
    assert set(flight.streams) == {"setpoint"}
    assert set(read(tmp_path, written(tmp_path, "LOCAL_POSITION_NED.csv", table)).streams) == {"estimator"}


def test_messages_in_one_table_are_estimate_and_set_point(tmp_path):
    t, p, table = mavlink("POSITION_TARGET_LOCAL_NED.")
    table |= {f"LOCAL_POSITION_NED.{k}": c for k, c in named(XYZ, (p + 0.2) @ TO_NED.T).items()}
    flight = read(tmp_path, written(tmp_path, "log.csv", {"timestamp": 1.7e9 + t, **table}))
    np.testing.assert_allclose(flight["setpoint"][XYZ], p, atol=1e-6)
    np.testing.assert_allclose(flight["estimator"][XYZ], p + 0.2, atol=1e-6)


def test_what_the_vehicle_ignores_is_no_set_point(tmp_path):
    t, _, table = mavlink(mask=1024 + 7)
    path = written(tmp_path, "a.csv", {"time_boot_ms": np.round(1e3 * t), **table})
    with pytest.raises(InputError, match="no column except 'time_boot_ms'"):
        draft_columns(path)
    table["type_mask"] = np.where(t > 5.0, 3064.0, 3064.0 + 2.0)
    draft = draft_columns(written(tmp_path, "b.csv", {"time_boot_ms": np.round(1e3 * t), **table}))
    assert ("setpoint", "y") not in draft.mapped
    assert ("setpoint", "x") in draft.mapped
    (question,) = draft.questions
    assert "ignore" in question


def test_a_set_point_in_axes_of_the_body_is_a_question(tmp_path):
    t, _, table = mavlink(frame=8)
    with pytest.raises(InputError, match="MAV_FRAME 8"):
        draft_columns(written(tmp_path, "a.csv", {"time_boot_ms": np.round(1e3 * t), **table}))


def test_an_attitude_target_is_a_command_of_thrust_alone(tmp_path):
    t, *_, turn, w = flown()
    table = {"time_boot_ms": np.round(1e3 * t), "type_mask": 0.0 * t,
             **named([f"q[{k}]" for k in range(4)], turn.as_quat()[:, [3, 0, 1, 2]]),
             **named([f"body_{a}_rate" for a in ("roll", "pitch", "yaw")], w), "thrust": 0.5 + 0.1 * np.sin(t)}
    flight = read(tmp_path, written(tmp_path, "a.csv", table))
    assert set(flight.streams) == {"command"}


def test_the_global_position_has_centimetres_a_second(tmp_path):
    t, p, v, *_ = flown()
    table = {"time_boot_ms": np.round(1e3 * t), "relative_alt": 1e3 * p[:, 2],
             **named(("vx", "vy", "vz"), np.round(100.0 * v @ TO_NED.T))}
    flight = read(tmp_path, written(tmp_path, "a.csv", table))
    np.testing.assert_allclose(flight["estimator"]["vx", "vy", "vz"], v, atol=6e-3)


def test_mavros_writes_its_set_points_in_our_axes(tmp_path):
    t, p, v, a, *_ = flown()
    table = {"%time": 1e9 * (1.7e9 + t), "field.coordinate_frame": 1.0 + 0.0 * t, "field.type_mask": 0.0 * t,
             **named([f"field.position.{k}" for k in XYZ], p), **named([f"field.velocity.{k}" for k in XYZ], v),
             **named([f"field.acceleration_or_force.{k}" for k in XYZ], a), "field.yaw": 0.3 * np.sin(t)}
    flight = read(tmp_path, written(tmp_path, "raw.csv", table))
    assert set(flight.streams) == {"setpoint"}
    np.testing.assert_allclose(flight["setpoint"][XYZ], p, atol=1e-6)
    np.testing.assert_allclose(flight["setpoint"]["yaw"], 0.3 * np.sin(t), atol=1e-6)


def test_poses_in_a_file_named_after_a_set_point_are_a_question(tmp_path):
    t, p, *_ = flown()
    table = {"%time": 1e9 * (1.7e9 + t), **named([f"field.pose.position.{k}" for k in XYZ], p)}
    with pytest.raises(InputError, match="named after a set-point"):
        draft_columns(written(tmp_path, "mavros-setpoint_position-local.csv", table))
    assert ("mocap", "px") in draft_columns(written(tmp_path, "mavros-vision_pose.csv", table)).mapped


def test_a_renamed_set_point_of_px4_is_not_the_estimate(tmp_path):
    t, p, v, a, *_ = flown()
    table = {"timestamp": 1e6 * t, **named(XYZ, p @ TO_NED.T), **named(("vx", "vy", "vz"), v @ TO_NED.T)}
    assert set(read(tmp_path, written(tmp_path, "a.csv", table)).streams) == {"estimator"}
    table |= {"yawspeed": 0.0 * t, **named([f"thrust[{k}]" for k in range(3)], a)}
    flight = read(tmp_path, written(tmp_path, "b.csv", table))
    assert set(flight.streams) == {"setpoint"}
    np.testing.assert_allclose(flight["setpoint"][XYZ], p, atol=1e-6)


def test_ardupilots_targets_are_apart_from_what_was_measured(tmp_path):
    t, p, v, *_ = flown()
    table = {"TimeUS": 1e6 * t, **named(("TPN", "TPE", "TPD"), (p + 0.2) @ TO_NED.T),
             **named(("PN", "PE", "PD"), p @ TO_NED.T), **named(("TVN", "TVE", "TVD"), v)}
    flight = read(tmp_path, written(tmp_path, "PSC.csv", table))
    np.testing.assert_allclose(flight["setpoint"][XYZ], p + 0.2, atol=1e-6)
    np.testing.assert_allclose(flight["estimator"][XYZ], p, atol=1e-6)
    with pytest.raises(InputError, match="no column except 'TimeUS'"):
        draft_columns(written(tmp_path, "GUIP.csv", {"TimeUS": 1e6 * t, **named(("pX", "pY", "pZ"), p)}))


def test_qgroundcontrol_writes_the_estimate_and_its_set_point(tmp_path):
    t, p, *_, turn, _ = flown()
    of = type(turn).from_matrix(TO_NED @ turn.as_matrix() @ np.diag([1.0, -1.0, -1.0]))
    table = {"Timestamp": 1e3 * t, **named(("heading", "pitch", "roll"), of.as_euler("ZYX", degrees=True)),
             **named([f"localPosition.{k}" for k in XYZ], p @ TO_NED.T),
             **named([f"localPositionSetpoint.{k}" for k in XYZ], (p + 0.2) @ TO_NED.T)}
    flight = read(tmp_path, written(tmp_path, "a.csv", table))
    np.testing.assert_allclose(flight["estimator"][XYZ], p, atol=1e-6)
    np.testing.assert_allclose(flight["setpoint"][XYZ], p + 0.2, atol=1e-6)
    found = type(turn).from_euler("ZYX", flight["attitude"]["yaw", "pitch", "roll"])
    assert (found.inv() * turn).magnitude().max() < 1e-5


@pytest.mark.parametrize("message", ["ATT_POS_MOCAP", "VISION_POSITION_ESTIMATE"])
def test_poses_that_mavlink_brings_from_outside_are_the_motion_capture(tmp_path, message):
    t, p, *_, turn, _ = flown()
    of = type(turn).from_matrix(TO_NED @ turn.as_matrix() @ np.diag([1.0, -1.0, -1.0]))
    table = {"usec" if "VISION" in message else "time_usec": np.round(1e6 * t), **named(XYZ, p @ TO_NED.T)}
    table |= named(("yaw", "pitch", "roll"), of.as_euler("ZYX")) if "VISION" in message else \
        named([f"q[{k}]" for k in range(4)], of.as_quat()[:, [3, 0, 1, 2]])
    flight = read(tmp_path, written(tmp_path, f"{message}.csv", table))
    np.testing.assert_allclose(flight["mocap"]["px", "py", "pz"], p, atol=1e-6)
    found = type(turn).from_quat(flight["mocap"]["qx", "qy", "qz", "qw"]) if message == "ATT_POS_MOCAP" else \
        type(turn).from_euler("ZYX", flight["mocap"]["yaw", "pitch", "roll"])
    assert (found.inv() * turn).magnitude().max() < 1e-5
