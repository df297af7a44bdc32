"""A path in another unit contradicts gravity: by its tilt, its accelerations, or an axis of millimetres."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from nanobench_tools.auditing.faults import axis_swap, frame, sign
from nanobench_tools.flight import Flight, make_stream
from nanobench_tools.signals.context import Context
from nanobench_tools.signals.quaternions import quaternion_orders
from nanobench_tools.signals.tilt_heading import other_height, wrong_heading
from nanobench_tools.signals.unit_sign_errors import wrong_units

STEP_S = 1 / 30
POSES = ("px", "py", "pz", "qx", "qy", "qz", "qw")


def multirotor(turning=1.0, noise_m=0.0):
    """Poses of a figure of 1.0 by 0.8 m at 1 m, tilted as gravity demands, 12 s at 30 Hz."""
    t = np.arange(0.0, 12.0, STEP_S)
    w, u = 2 * np.pi / 3.0, 2 * np.pi / 2.4
    p = np.stack([1.0 * np.sin(w * t), 0.8 * np.sin(u * t), 1.0 + 0.05 * np.sin(w * t / 2)], axis=1)
    a = np.stack([-w**2 * p[:, 0], -u**2 * p[:, 1]], axis=1) / 9.81
    half = 0.5 * turning * np.stack([-a[:, 1], a[:, 0]], axis=1)
    q = np.column_stack([half, np.zeros(len(t)), np.sqrt(1.0 - (half**2).sum(axis=1))])
    p += np.random.default_rng(1).normal(0.0, noise_m, p.shape) if noise_m else 0.0
    return Flight("f", {"mocap": make_stream("mocap", t, np.hstack([p, q]), POSES)}, {}, None)


def scaled(flight, by=1.0, axis=None, time=1.0):
    s = flight["mocap"]
    values = s.values.copy()
    if axis is not None:
        values[:, axis] *= by
    return flight.with_streams(mocap=replace(s, values=values, time_s=s.time_s * time))


def reported(flight):
    return {(w.stream, q) for w in wrong_units(Context(flight)) for q in w.quantities}


@pytest.mark.parametrize("noise_m", [0.0, 2e-4])
def test_the_path_of_a_multirotor_is_right(noise_m):
    assert reported(multirotor(noise_m=noise_m)) == set()


@pytest.mark.filterwarnings("error")
def test_a_path_that_never_moves_has_no_unit():
    flight = multirotor()
    still = replace(flight["mocap"], values=np.concatenate([np.zeros_like(flight["mocap"].values[:, :3]),
                                                            flight["mocap"].values[:, 3:]], axis=1))
    assert not {("mocap", q) for q in POSES[:3]} & reported(flight.with_streams(mocap=still))


@pytest.mark.parametrize("by", [0.001, 0.01, np.pi / 180, 100.0])
@pytest.mark.parametrize("axis", [0, 1])
def test_an_axis_that_the_tilt_contradicts(axis, by):
    assert ("mocap", POSES[axis]) in reported(scaled(multirotor(), by, axis))


@pytest.mark.parametrize("time", [1e-3, 100.0, 180 / np.pi])
def test_time_in_another_unit(time):
    assert ("", "t") in reported(scaled(multirotor(), time=time))


def test_a_thin_axis_without_attitude():
    flight = scaled(multirotor(), 0.001, 0)
    poses = flight["mocap"]
    alone = flight.with_streams(mocap=make_stream("mocap", poses.time_s, poses.values[:, :3], POSES[:3]))
    assert reported(alone) == {("mocap", "px")}


@pytest.mark.parametrize("axes", [(0,), (0, 2), (0, 1)])
def test_a_line_and_a_plane_are_no_other_unit(axes):
    """A rail, a flight straight ahead, a car: what a tracker sees of the other axes is its noise."""
    t = np.arange(0.0, 20.0, 0.01)
    position = np.random.default_rng(3).normal(0.0, 2e-4, (len(t), 3))
    for axis in axes:
        position[:, axis] += np.sin((0.7 + 0.2 * axis) * t)
    flight = Flight("f", {"mocap": make_stream("mocap", t, position, POSES[:3])}, {}, None)
    assert reported(flight) == set()
    thin = position * [1.0 if k in axes else 1e-3 for k in range(3)]
    assert reported(flight.with_streams(mocap=replace(flight["mocap"], values=thin)))


def test_a_smooth_flight_straight_ahead_by_its_tilt():
    """As a simulator gives it, without noise: it hardly tilts to the side."""
    flight = multirotor()
    values = flight["mocap"].values.copy()
    values[:, 1] *= 1e-3
    values[:, 3] *= 1e-3  # no roll
    values[:, 6] = np.sqrt(1.0 - (values[:, 3:6] ** 2).sum(axis=1))
    assert reported(flight.with_streams(mocap=replace(flight["mocap"], values=values))) == set()


def test_an_attitude_that_hardly_turns():
    assert reported(multirotor(turning=0.001)) >= {("mocap", q) for q in POSES[3:]}


def test_a_quaternion_whose_scalar_is_scaled():
    camera = np.array([0.66, 0.63, -0.28, 0.296])
    flight = multirotor()
    values = flight["mocap"].values.copy()
    values[:, 3:] = camera / np.linalg.norm(camera) * [1, 1, 1, 0.001]
    poses = replace(flight["mocap"], values=values)
    assert ("mocap", "qw") in reported(flight.with_streams(mocap=poses))


@pytest.mark.parametrize("turn_deg", [90.0, 180.0, -90.0])
def test_an_attitude_in_a_world_of_another_heading(turn_deg):
    flight = multirotor(noise_m=2e-4)
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    values = flight["mocap"].values.copy()
    values[:, :2] = values[:, :2] @ np.array([[c, s], [-s, c]])
    found = wrong_heading(Context(flight.with_streams(mocap=replace(flight["mocap"], values=values))))
    assert wrong_heading(Context(flight)) is None
    assert found is not None
    assert found[0] == pytest.approx(abs(np.radians(turn_deg)), abs=0.1)


def test_inverted_quaternions_are_not_a_wrong_heading():
    for flight, inverted in ((turning_about_z(), False), (turning_about_z(inverted=True), True)):
        context = Context(flight)
        assert wrong_heading(context) is None
        assert quaternion_orders(context)["mocap"].reading.inverted is inverted


def turning_about_z(inverted=False):
    """The flight of ``multirotor`` with a heading that goes round in 9 s."""
    flight = multirotor(noise_m=2e-4)
    poses = flight["mocap"]
    tilt = Rotation.from_quat(poses[POSES[3:]])
    turn = tilt * Rotation.from_euler("z", 2 * np.pi * poses.time_s[:, None] / 9.0)
    values = poses.values.copy()
    values[:, 3:] = (turn.inv() if inverted else turn).as_quat()
    return flight.with_streams(mocap=replace(poses, values=values))


def with_poses(flight, change):
    values = flight["mocap"].values.copy()
    change(values)
    return Context(flight.with_streams(mocap=replace(flight["mocap"], values=values)))


@pytest.mark.parametrize(("columns", "kind"), [(("px",), "sign"), (("py",), "sign"), (("px", "py"), "axis_swap")])
def test_a_mirrored_path_is_no_turned_world(columns, kind):
    def change(values):
        if kind == "sign":
            values[:, POSES.index(columns[0])] *= -1.0
        else:
            values[:, :2] = values[:, 1::-1]

    flight = multirotor(noise_m=2e-4)
    context = with_poses(flight, change)
    found = [(f.kind, f.columns) for check in (sign, axis_swap, frame) for f in check.find(context.flight, context)]
    assert found == [(kind, columns)]
    clean = Context(flight)
    assert [f for check in (sign, axis_swap, frame) for f in check.find(flight, clean)] == []


def standing(flight):
    """The flight with a rest on the ground before and after it."""
    poses = flight["mocap"]
    rise = np.clip(np.minimum(poses.time_s - 2.0, 10.0 - poses.time_s), 0.0, 1.0)[:, None]
    values = poses.values.copy()
    values[:, :3] *= rise
    values[:, :3] += np.random.default_rng(2).normal(0.0, 2e-4, (len(values), 3))
    values[:, 3:6] *= rise
    values[:, 6] = np.sqrt(1.0 - (values[:, 3:6] ** 2).sum(axis=1))
    return flight.with_streams(mocap=replace(poses, values=values))


@pytest.mark.parametrize(("kind", "columns"), [("sign", ("pz",)), ("axis_swap", ("py", "pz"))])
def test_a_height_that_the_tilt_contradicts(kind, columns):
    def change(values):
        if kind == "sign":
            values[:, 2] *= -1.0
        else:
            values[:, 1:3] = values[:, 2:0:-1]

    flight = standing(multirotor(noise_m=2e-4))
    context = with_poses(flight, change)
    found = [(f.kind, f.columns[:2]) for check in (sign, axis_swap, frame) for f in check.find(context.flight, context)]
    assert found in ([(kind, columns)], [("frame", columns)])
    assert other_height(Context(flight)) is None


@pytest.mark.parametrize(("by", "unit"), [(100.0, "centimetres"), (1000.0, "millimetres")])
def test_a_path_wider_than_a_room_is_in_the_unit_that_its_tilt_shows(by, unit):
    flight = multirotor(noise_m=2e-4)
    (found,) = wrong_units(Context(scaled(flight, by, slice(0, 3))))
    assert (found.factor, found.quantities) == (by, POSES[:3])
    assert found.evidence.endswith(f": {unit}")


def test_without_attitude_accelerations_leave_both_open_or_decide():
    flight = multirotor(noise_m=2e-4)
    poses = flight["mocap"]
    alone = flight.with_streams(mocap=make_stream("mocap", poses.time_s, poses.values[:, :3], POSES[:3]))
    (found,) = wrong_units(Context(scaled(alone, 1000.0, slice(0, 3))))
    assert found.evidence.endswith("millimetres or centimetres, and nothing shows which")
    (found,) = wrong_units(Context(scaled(alone, 100.0, slice(0, 3), 2.0)))
    assert found.evidence.endswith(": centimetres or inches or feet, and nothing shows which")


@pytest.mark.parametrize("attitude", [True, False])
def test_a_path_of_a_hundred_metres_is_in_metres(attitude):
    flight = multirotor()
    poses = flight["mocap"]
    values = poses.values.copy()
    values[:, 0] += 8.0 * poses.time_s
    far = flight.with_streams(mocap=make_stream("mocap", poses.time_s, values[:, :7 if attitude else 3],
                                                POSES[:7 if attitude else 3]))
    assert reported(far) == set()
