"""Gyro and attitude that contradict each other: the wrong one is reported where anything shows it, else both are."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from nanobench_tools.auditing.fault_events import events_of
from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.flight import Flight, Provenance, make_stream

GYRO = ("gyro_x", "gyro_y", "gyro_z")
POSE = ("px", "py", "pz", "qx", "qy", "qz", "qw")
SLOW = {"marks": pytest.mark.slow}
KINDS = ("sign", "axis_swap", "frame", "quaternion_order", "body_frame")


@pytest.fixture(scope="module")
def flown(crowd):
    """A figure of eight: roll and pitch move together, which looks like other axes; the heading is held."""
    return crowd.log("slow figure_eight")[0]


def _with(flight, *names):
    kept = flight.without_streams(*(set(flight.streams) - set(names)))
    if "mocap" not in names:
        return kept
    poses = flight["mocap"]
    return kept.with_streams(mocap=make_stream("mocap", poses.time_s, poses[POSE], POSE, rate_hz=poses.rate_hz))


def _changed(flight, stream, *columns):
    """One column negated, or two exchanged."""
    found = flight[stream]
    values, places = found.values.copy(), [found.index(q) for q in columns]
    values[:, places] = -values[:, places] if len(places) == 1 else values[:, places[::-1]]
    return flight.with_streams(**{stream: replace(found, values=values)})


def _found(flight):
    """{(stream, quantities)} of faults of axes and signs, and their sentences."""
    faults = [f for f in audit(flight).faults if f.kind in KINDS]
    return ({(f.stream, tuple(flight[f.stream].quantities[flight[f.stream].columns.index(c)] for c in f.columns))
             for f in faults}, [e.sentence for e in events_of(faults)])


@pytest.mark.parametrize("wrong", [("mocap", "qz"), pytest.param(("imu", "gyro_z"), **SLOW)])
def test_a_heading_that_is_held_leaves_open_which_one_is_negated(flown, wrong):
    found, said = _found(_changed(_with(flown, "mocap", "imu"), *wrong))
    assert found == {("mocap", ("qz",)), ("imu", ("gyro_z",))}
    assert len(said) == 1
    assert "gyro_z is negated; or qz of mocap is negated" in said[0]


@pytest.mark.parametrize("wrong", [
    ("mocap", "qx"), *(pytest.param(wrong, **SLOW) for wrong in [
        ("mocap", "qy", "qz"), ("mocap", "qx", "qy"), ("imu", "gyro_x"), ("imu", "gyro_x", "gyro_y")]),
    ("imu", "gyro_y", "gyro_z")])
def test_the_tilt_along_the_path_shows_which_one_is_wrong(flown, wrong):
    found, said = _found(_changed(_with(flown, "mocap", "imu"), *wrong))
    assert found == {(wrong[0], wrong[1:])}
    assert not any("; or" in text for text in said)


@pytest.mark.parametrize("wrong", [("mocap", "qz"), pytest.param(("imu", "gyro_z"), **SLOW)])
def test_the_estimate_is_a_third_witness(flown, wrong):
    found, _ = _found(_changed(_with(flown, "mocap", "imu", "attitude_qw"), *wrong))
    assert found == {(wrong[0], wrong[1:])}


@pytest.mark.parametrize("wrong", [("attitude", "roll"), *(
    pytest.param(wrong, **SLOW) for wrong in [("imu", "gyro_x"), ("imu", "gyro_x", "gyro_y")])])
def test_the_motors_show_it_without_a_path(flown, wrong):
    found, _ = _found(_changed(_with(flown, "attitude", "imu", "motor"), *wrong))
    assert found == {(wrong[0], wrong[1:])}


@pytest.mark.parametrize(("wrong", "both"), [
    (("attitude", "yaw"), {("attitude", ("yaw",)), ("imu", ("gyro_z",))}),
    (("imu", "gyro_x"), {("attitude", ("roll",)), ("imu", ("gyro_x",))})])
def test_an_estimate_and_a_gyro_alone_are_a_question(flown, wrong, both):
    found, said = _found(_changed(_with(flown, "attitude", "imu"), *wrong))
    assert found == both
    assert len(said) == 1


@pytest.mark.parametrize("wrong", [("mocap", "qz"), pytest.param(("imu", "gyro_z"), **SLOW)])
def test_the_set_point_of_the_heading_decides(wrong):
    found, _ = _found(_changed(_turning_on_the_spot(), *wrong))
    assert found == {(wrong[0], wrong[1:])}


def _turning_on_the_spot():
    """Turns of the heading in a hover of 14 s, commanded 0.1 s before; the tilt is noise."""
    t, rng = np.arange(0.0, 14.0, 0.01), np.random.default_rng(8)
    up = np.interp(t, [2.0, 3.0, 12.0, 13.0], [0.0, 1.0, 1.0, 0.0])

    def yaw(at):
        return 0.8 * np.sin(1.1 * (at - 3.0)) * np.interp(at, [3.0, 4.0, 11.0, 12.0], [0.0, 1.0, 1.0, 0.0])

    tilt = 0.02 * np.stack([np.sin(5.0 * t), np.sin(6.3 * t)], axis=1) * up[:, None]
    turn = Rotation.from_euler("ZYX", np.column_stack([yaw(t), tilt[:, 1], tilt[:, 0]]))
    place = np.column_stack([0.0 * t, 0.0 * t, up]) + 3e-4 * rng.standard_normal((len(t), 3))
    rate = (turn[:-2].inv() * turn[2:]).as_rotvec() / 0.02
    gyro = np.vstack([rate[:1], rate, rate[-1:]]) + 0.01 * rng.standard_normal((len(t), 3))
    force = np.array([0.0, 0.0, 9.81]) + 0.1 * rng.standard_normal((len(t), 3))
    return Flight("spot", {
        "mocap": make_stream("mocap", t, np.hstack([place, turn.as_quat()]), POSE, rate_hz=100.0),
        "imu": make_stream("imu", t, np.hstack([gyro, force]), (*GYRO, "acc_x", "acc_y", "acc_z"), rate_hz=100.0),
        "setpoint": make_stream("setpoint", t, np.column_stack([0.0 * t, 0.0 * t, up, yaw(t + 0.1)]),
                                ("x", "y", "z", "yaw"), rate_hz=100.0),
    }, {}, Provenance("spot", "", "test"))


def test_what_agrees_is_no_finding(flown):
    for names in (("mocap", "imu"), ("attitude_qw", "imu", "estimator"), ("attitude", "imu", "motor")):
        assert _found(_with(flown, *names))[0] == set()


@pytest.fixture(scope="module")
def positions():
    """A circle by the equations of a rigid body: positions without an attitude, estimated angles, a gyro."""
    t = np.arange(0.0, 20.0, 0.01)
    ramp = np.clip((t - 3.0) / 3.0, 0.0, 1.0) * np.clip((17.0 - t) / 3.0, 0.0, 1.0)
    ramp = ramp * ramp * (3.0 - 2.0 * ramp)
    p = np.stack([ramp * np.sin(1.5 * t), ramp * np.cos(1.5 * t), ramp], axis=1)
    up = np.array([0.0, 0.0, 9.81]) + np.gradient(np.gradient(p, 0.01, axis=0), 0.01, axis=0)
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    left = np.cross(up, [1.0, 0.0, 0.0])
    left /= np.linalg.norm(left, axis=1, keepdims=True)
    turn = Rotation.from_matrix(np.stack([np.cross(left, up), left, up], axis=2))
    gyro = (turn[:-1].inv() * turn[1:]).as_rotvec() / 0.01
    return Flight("circle", {
        "mocap": make_stream("mocap", t, p, POSE[:3]),
        "attitude": make_stream("attitude", t, turn.as_euler("ZYX")[:, ::-1], ("roll", "pitch", "yaw")),
        "imu": make_stream("imu", t[:-1] + 0.005, gyro, GYRO)}, {}, Provenance("made", "", "test"))


@pytest.mark.parametrize("heading_deg", [0.0, 50.0, 180.0])
def test_positions_confirm_the_angles_at_any_heading_between_the_worlds(positions, heading_deg):
    path = positions["mocap"]
    turned = Rotation.from_euler("z", heading_deg, degrees=True).apply(path.values)
    assert _found(positions.with_streams(mocap=replace(path, values=turned)))[0] == set()


@pytest.mark.parametrize(("angle", "gyro"), [("roll", "gyro_x"), ("pitch", "gyro_y")])
@pytest.mark.parametrize("both", [True, False])
def test_positions_show_an_angle_that_is_negated_with_the_gyro_and_without(positions, angle, gyro, both):
    wrong = _changed(positions, "attitude", angle)
    found, _ = _found(_changed(wrong, "imu", gyro) if both else wrong)
    assert found == {("attitude", (angle,))} | ({("imu", (gyro,))} if both else set())


def test_positions_show_a_negated_gyro(positions):
    assert _found(_changed(positions, "imu", "gyro_y"))[0] == {("imu", ("gyro_y",))}


def test_positions_show_a_negated_pitch_in_a_world_of_another_heading(positions):
    """As of a compass: headings from north, and a pitch that is positive nose up."""
    path = positions["mocap"]
    turned = Rotation.from_euler("z", 70.0, degrees=True).apply(path.values)
    wrong = _changed(_changed(positions, "attitude", "pitch"), "imu", "gyro_y")
    found, _ = _found(wrong.with_streams(mocap=replace(path, values=turned)))
    assert found == {("attitude", ("pitch",)), ("imu", ("gyro_y",))}
