"""A turned frame is one finding, and the stream that is turned as it says is clean."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from nanobench_tools import so3
from nanobench_tools.auditing.fault_events import events_of
from nanobench_tools.auditing.faults import axis_swap, body_frame, frame, quaternion_order, sign
from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.flight import Span
from nanobench_tools.signals.context import Context
from nanobench_tools.signals.stream_frames import IMU, ROTATIONS
from nanobench_tools.sources.axes import frame_of, in_our_axes

POSITION, ROTATION = ("px", "py", "pz"), ("qx", "qy", "qz", "qw")
CHECKS = (frame, sign, axis_swap, quaternion_order, body_frame)
NED, Y_UP = np.diag([1.0, -1.0, -1.0]), np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])
NORTH_EAST = np.array([[0, 1.0, 0], [1.0, 0, 0], [0, 0, -1.0]])
X_UP = np.array([[0, 0, 1.0], [0, 1.0, 0], [-1.0, 0, 0]])


def about_frames(flight):
    context = Context(flight)
    return [(f.kind, f.stream, f.columns, f.evidence) for check in CHECKS for f in check.find(flight, context)]


def with_vectors(flight, stream, turns):
    """``turns``: {quantities: (3, 3)} applied to the stored vectors."""
    s = flight[stream]
    values = s.values.copy()
    for names, turn in turns.items():
        values[:, [s.index(q) for q in names]] = s[names] @ turn.T
    return flight.with_streams(**{stream: replace(s, values=values)})


def with_imu(flight, turn):
    return with_vectors(flight, "imu", dict.fromkeys(IMU, turn))


def with_poses(flight, world, body):
    """Poses in a world and of a body whose vectors are ``world`` and ``body`` times ours."""
    s = flight["mocap"]
    values = s.values.copy()
    for names, turn in ((POSITION, world), (("vx", "vy", "vz"), world), (("wx", "wy", "wz"), body)):
        if all(q in s for q in names):
            values[:, [s.index(q) for q in names]] = s[names] @ turn.T
    left, right = (Rotation.from_matrix(turn).as_quat() for turn in (world, body.T))
    values[:, [s.index(q) for q in ROTATION]] = so3.multiply(so3.multiply(left, s[ROTATION]), right)
    columns = [k for k, q in enumerate(s.quantities) if q not in ("roll", "pitch", "yaw")]
    kept = replace(s, values=values[:, columns], columns=tuple(s.columns[k] for k in columns),
                   quantities=tuple(s.quantities[k] for k in columns), unit=tuple(s.unit[k] for k in columns))
    return flight.with_streams(mocap=kept)


def advised(evidence):
    """{quantity: (sign, quantity as stored)} of what an evidence tells to do."""
    told = evidence.partition(", since ")[0]
    if signs := re.search(r"change the sign of (.*)$", told):
        return {name: (-1, name) for name in re.split(r", | and ", signs[1])}
    return {new: (-1 if minus else 1, old) for new, minus, old in re.findall(r"(\w+) = (-?)(\w+)", told)}


def following(flight, stream, advice):
    s = flight[stream]
    values = s.values.copy()
    for new, (factor, old) in advice.items():
        values[:, s.index(new)] = factor * s[old]
    return flight.with_streams(**{stream: replace(s, values=values)})


@pytest.fixture(scope="module")
def flown(crowd):
    names = ("fast figure_eight", "star", "slow trefoil", "helix", "circle")
    return {name: crowd.log(name)[0].during(Span(0.0, 18.0)) for name in names}


@pytest.mark.parametrize("name", ["fast figure_eight", "star", "slow trefoil", "helix", "circle"])
def test_frames_of_the_convention_are_no_finding(flown, name):
    assert about_frames(flown[name]) == []


def axes_id(turn):
    return "".join(f"{int(v):+d}"[0] + "xyz"[j] for row in turn for j, v in enumerate(row) if v)


@pytest.mark.parametrize(("turn", "name"), [
    pytest.param(turn, ("fast figure_eight", "slow trefoil", "helix")[k % 3], id=axes_id(turn),
                 marks=[pytest.mark.slow] if k % 3 else [])
    for k, turn in enumerate(ROTATIONS[1:])])
def test_an_imu_in_any_other_axes_is_one_finding_and_the_advice_mends_it(flown, turn, name):
    bad = with_imu(flown[name], turn)
    ((kind, stream, columns, evidence),) = about_frames(bad)
    assert (kind, stream) == ("frame", "imu")
    moved = [k for k in range(3) if turn[k, k] < 1.0]
    assert set(columns) == {bad["imu"].columns[bad["imu"].index(v[k])] for v in IMU for k in moved}
    axes = frame_of(re.search(r"is in (\S+) axes", evidence)[1])
    assert about_frames(bad.with_streams(imu=in_our_axes(bad["imu"], axes))) == []
    np.testing.assert_allclose(following(bad, "imu", advised(evidence))["imu"].values, flown[name]["imu"].values)


def test_the_sign_of_an_axis_without_motion_turns_with_the_others(flown):
    """The yaw of these flights hardly moves, and the noise of acc_y shows no sign."""
    flight = flown["circle"]
    quiet = flight["imu"].values.copy()
    rng = np.random.default_rng(4)
    for q in ("gyro_z", "acc_y"):
        quiet[:, flight["imu"].index(q)] = 0.05 * rng.standard_normal(len(quiet))
    flight = flight.with_streams(imu=replace(flight["imu"], values=quiet))
    ((_, _, columns, evidence),) = about_frames(with_imu(flight, NED))
    assert "FRD axes (forward, right, down)" in evidence
    assert set(advised(evidence)) == {"gyro_y", "gyro_z", "acc_y", "acc_z"}
    assert len(columns) == 4


@pytest.mark.parametrize(("column", "kind"), [("gyro_x", "sign"), ("gyro_y", "sign"), ("acc_z", "sign")])
def test_one_negated_column_is_no_frame(flown, column, kind):
    flight = flown["fast figure_eight"]
    s = flight["imu"]
    values = s.values.copy()
    values[:, s.index(column)] *= -1.0
    found = about_frames(flight.with_streams(imu=replace(s, values=values)))
    assert [(f[0], f[1]) for f in found] == [(kind, "imu")]


@pytest.mark.parametrize("name", ["fast figure_eight", *(pytest.param(name, marks=pytest.mark.slow)
                                                         for name in ("star", "helix"))])
@pytest.mark.parametrize("others", [False, True], ids=["poses alone", "with the vehicle's streams"])
@pytest.mark.parametrize(("world", "body", "words"), [
    (NED, NED, r"(NE|ES)D/FRD"), (NORTH_EAST, NED, "NED/FRD"), (NED, np.eye(3), r"(NE|ES)D/FLU"),
    (Y_UP, Y_UP, "EUS/FUR"), (Y_UP, np.eye(3), "EUS/FLU"), (X_UP, X_UP, "UNW/ULB"),
    (np.eye(3), NED, "ENU/FRD"), (np.eye(3), X_UP, "ENU/ULB"),
])
def test_poses_in_another_frame(flown, name, world, body, words, others):
    flight = flown[name] if others else flown[name].without_streams(*set(flown[name].streams) - {"mocap"})
    bad = with_poses(flight, world, body)
    poses = [f for f in about_frames(bad) if f[1] == "mocap"]
    if not others and np.array_equal(world, np.eye(3)):
        assert [f[0] for f in poses] == ["body_frame"]
    else:
        ((kind, _, _, evidence),) = poses
        assert kind == "frame"
        axes = re.search(r"is in (\S+) axes", evidence)[1]
        assert re.fullmatch(words, axes)
        assert about_frames(bad.with_streams(mocap=in_our_axes(bad["mocap"], frame_of(axes)))) == []


@pytest.mark.parametrize(("angle_deg", "kinds"), [(0.0, []), (20.0, []), (70.0, []), (-65.0, []), (155.0, []),
                                                  (90.0, ["frame"]), (-90.0, ["frame"]), (180.0, ["frame"])])
def test_an_estimate_in_a_world_of_another_heading_has_no_other_axes(flown, angle_deg, kinds):
    """Only quarter turns are axes; advice to swap axes would leave any other heading turned."""
    turn = Rotation.from_euler("z", angle_deg, degrees=True).as_matrix()
    flight = with_vectors(flown["star"], "estimator", {("x", "y", "z"): turn, ("vx", "vy", "vz"): turn})
    assert [k for k, stream, *_ in about_frames(flight) if stream == "estimator"] == kinds


def test_everything_in_north_east_down_is_one_event(flown):
    flight = with_imu(with_poses(flown["fast figure_eight"].without_streams("estimator", "setpoint", "attitude",
                                                                            "attitude_qw", "pid", "estimator_acc"),
                                 NED, NED), NED)
    found = [f for f in audit(flight).faults if f.kind == "frame"]
    assert {f.stream for f in found} == {"mocap", "imu"}
    assert all("FRD axes" in f.evidence for f in found)
    assert [e.kind for e in events_of(found)] == ["frame"]


def test_a_slow_flight_shows_down_by_the_ground(flown):
    """Positions alone, of a hover that stands before and after it."""
    rng = np.random.default_rng(2)
    t = np.arange(0.0, 20.0, 0.02)
    rise = np.clip(np.minimum(t - 2.0, 18.0 - t) / 2.0, 0.0, 1.0)
    p = np.stack([0.3 * np.sin(0.4 * t) * rise, 0.3 * np.cos(0.4 * t) * rise, rise], axis=1)
    p += 3e-4 * rng.standard_normal(p.shape)
    flight = flown["circle"].without_streams(*set(flown["circle"].streams) - {"mocap"})
    s = flight["mocap"]
    for world, words in ((NED, "NED/FRD"), (Y_UP, "EUS/FUR")):
        poses = np.column_stack([p @ world.T, np.tile([0.0, 0.0, 0.0, 1.0], (len(t), 1))])
        bad = flight.with_streams(mocap=replace(s, time_s=t, values=poses, columns=POSITION + ROTATION,
                                                quantities=POSITION + ROTATION, unit=("m",) * 3 + ("1",) * 4,
                                                samples=None))
        ((kind, _, _, evidence),) = about_frames(bad)
        assert kind == "frame"
        assert re.search(r"is in (\S+) axes", evidence)[1] == words
        (span,) = audit(bad).airborne
        assert (span.start_s, span.end_s) == pytest.approx((2.2, 17.8), abs=0.4)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("body", "kinds"), [(NED, []), (np.eye(3), ["body_frame"])])
def test_a_slow_flight_without_take_off_shows_no_axes_by_chance(flown, seed, body, kinds):
    """Poses in a world with z down: 20 cm in 10 s tilt the vehicle by half a degree."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 30.0, 0.02)
    w = 2.0 * np.pi / 10.0
    p = np.stack([0.2 * np.sin(w * t + rng.uniform(0.0, 6.0)), 0.2 * np.sin(0.7 * w * t),
                  1.0 + 0.06 * np.sin(0.5 * w * t)], axis=1)
    pull = np.gradient(np.gradient(p, 0.02, axis=0), 0.02, axis=0) / 9.81
    turn = Rotation.from_euler("zyx", np.column_stack([0.5 * np.sin(0.3 * w * t), pull[:, 0], -pull[:, 1]]))
    p += 5e-4 * rng.standard_normal(p.shape)
    stream = flown["circle"]["mocap"]
    poses = np.column_stack([p, turn.as_quat()])
    still = flown["circle"].without_streams(*set(flown["circle"].streams) - {"mocap"}).with_streams(
        mocap=replace(stream, time_s=t, values=poses, columns=POSITION + ROTATION, quantities=POSITION + ROTATION,
                      unit=("m",) * 3 + ("1",) * 4, samples=None))
    assert about_frames(still) == []
    found = about_frames(with_poses(still, NORTH_EAST, NORTH_EAST if body is NED else body))
    assert [kind for kind, *_ in found] == kinds
    assert all("or z of its world points down" in evidence for *_, evidence in found)


def hand_held(seconds=12.0, tilt_deg=130.0, seed=5):
    """A camera that looks ahead and is carried about, z of its body forward."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 1.0 / 30.0)
    p = np.stack([0.6 * np.sin(0.7 * t), 0.3 * np.cos(0.5 * t), 1.4 + 0.2 * np.sin(0.9 * t)], axis=1)
    look = Rotation.from_euler("zyx", np.column_stack([0.4 * np.sin(0.6 * t), np.full_like(t, np.radians(tilt_deg)),
                                                       0.3 + 0.15 * np.sin(1.1 * t)]))
    return t, np.column_stack([p + 5e-4 * rng.standard_normal(p.shape), look.as_quat()])


@pytest.mark.parametrize("tilt_deg", [55.0, 132.0, 150.0])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_hand_held_camera_neither_crashed_nor_stayed_on_the_ground(flown, tilt_deg, seed):
    t, poses = hand_held(tilt_deg=tilt_deg, seed=seed)
    flight = flown["circle"].without_streams(*set(flown["circle"].streams) - {"mocap"})
    flight = flight.with_streams(mocap=replace(flight["mocap"], time_s=t, values=poses, columns=POSITION + ROTATION,
                                               quantities=POSITION + ROTATION, unit=("m",) * 3 + ("1",) * 4,
                                               samples=None))
    found = audit(flight)
    assert [f.kind for f in found.faults] == ["body_frame"]
    assert found.airborne == ()


@pytest.mark.parametrize("kept", [("imu",), ("imu", "motor", "battery")])
@pytest.mark.parametrize("turn", [NED, np.diag([-1.0, 1.0, -1.0]), X_UP, X_UP.T], ids=["FRD", "BLD", "x up", "x down"])
def test_a_lone_imu_is_asked_about_as_a_whole(flown, turn, kept):
    """Gravity shows which axis is up, and no more. Each answer leaves a clean audit, with motors only the right one."""
    flight = flown["fast figure_eight"]
    bad = with_imu(flight.without_streams(*(set(flight.streams) - set(kept))), turn)
    ((kind, stream, _, evidence),) = about_frames(bad)
    assert (kind, stream) == ("frame", "imu")
    assert ("most likely in FRD axes" in evidence) == (turn[2, 2] < 0.0)
    offered = re.findall(r"\b[FBLRUD]{3}\b", evidence)
    assert len(set(offered)) == 4
    turned = [in_our_axes(bad["imu"], frame_of(name)) for name in offered]
    right = [all(np.allclose(imu[v], flight["imu"][v]) for v in IMU) for imu in turned]
    assert sum(right) == 1
    clean = [about_frames(bad.with_streams(imu=imu)) == [] for imu in turned]
    assert clean == (right if "motor" in kept else [True] * 4)


def test_a_lone_imu_in_our_axes_is_no_finding(flown):
    flight = flown["fast figure_eight"]
    assert about_frames(flight.without_streams(*(set(flight.streams) - {"imu"}))) == []


def test_euler_angles_show_the_frame_of_an_imu_as_well(flown):
    flight = flown["fast figure_eight"]
    alone = flight.without_streams(*(set(flight.streams) - {"imu", "attitude"}))
    ((kind, stream, columns, evidence),) = about_frames(with_imu(alone, NED))
    assert (kind, stream, len(columns)) == ("frame", "imu", 4)
    assert "is in FRD axes" in evidence


def test_an_attitude_in_north_east_down_next_to_a_position_with_z_up(flown):
    ours = flown["fast figure_eight"]
    mocap = with_poses(ours, NORTH_EAST, NED)["mocap"]
    values = mocap.values.copy()
    for q in (*POSITION, "vx", "vy", "vz"):
        values[:, mocap.index(q)] = ours["mocap"][q]
    poses = ours.without_streams(*(name for name in ours.streams if name != "mocap"))
    ((kind, _, columns, words),) = about_frames(poses.with_streams(mocap=replace(mocap, values=values)))
    assert (kind, columns) == ("frame", ROTATION)
    assert "the attitude is in north, east, down (NED, body FRD)" in words
