"""Axes that all streams of a recording share: a table that is NED and FRD as a whole agrees with itself.

The flight decides: the tilt against the acceleration of the path, and the ground below it. With motion capture these
are ``pose_frame``. Other streams share its axes where their comparison with the turned poses gives the same turn.
Without motion capture the estimated position and attitude are judged in the same way.
"""

from dataclasses import dataclass

import numpy as np

from .. import so3
from ..flight import Stream
from ..sources.axes import Frame, frame_of, in_our_axes, name_of
from .axis_unit_matching import CLEAR, AxisUnitMatch, axis_unit_matches
from .context import Context
from .estimated_turning import EULER, estimated_attitude, rates_of
from .flown_axes import FOLLOWS, NAMES, UP, UPRIGHT, Axis, Tilt, ground_axes_of, tilts, tilts_of
from .gravity import gravity_axis
from .pose_frame import ALMOST_ALL, BODIES, CLEARLY, DOWN, OTHER_FOLLOWS, WORLDS, pose_frame, posed
from .usable_rows import usable_streams

HEADINGS_DOWN = tuple(frame_of(name).world for name in ("NED", "ESD", "SWD", "WND"))
"""Worlds with z down."""
FRAMED = ("estimator", "estimator_acc", "attitude", "attitude_qw", "imu", "setpoint", "pid")
PLACE = ("x", "y", "z")
GYRO = ("gyro_x", "gyro_y", "gyro_z")


@dataclass(frozen=True)
class SharedFrame:
    """``axes``: those of all ``streams``; ``why``: the evidence in words."""

    axes: Frame
    streams: tuple[str, ...]
    why: str


def shared_frame(context: Context) -> SharedFrame | None:
    """None where nothing is turned, or the motion capture alone."""
    if "mocap" not in context.flight:
        return _by_estimate(context)
    frame = context.once(pose_frame)
    matches: dict[str, list[AxisUnitMatch]] = {}
    for match in context.once(axis_unit_matches).values():
        if match.stream != "mocap":
            matches.setdefault(match.stream, []).append(match)
    if not frame.turned:
        return _of_vehicle(context, matches)
    streams = _turned_alike(matches, frame.axes)
    return SharedFrame(frame.axes, ("mocap", *streams), frame.evidence) if streams else None


def _turned_alike(matches: dict[str, list[AxisUnitMatch]], axes: Frame) -> tuple[str, ...]:
    """Streams that differ from the poses, and in every clear axis as a stream in ``axes`` does."""
    return tuple(name for name, found in matches.items()
                 if any(m.swapped or min(m.sign) < 0 for m in found) and all(_turned_so(m, axes) for m in found))


def _of_vehicle(context: Context, matches: dict[str, list[AxisUnitMatch]]) -> SharedFrame | None:
    """Streams of the vehicle in axes with z down, where the flight shows that the poses have z up."""
    usual = context.once(tilts)["x, y, z, w"].get((UP, UP))
    if usual is None or not usual.flies:
        return None
    found = {name_of(world, True): streams for world in HEADINGS_DOWN
             if (streams := _turned_alike(matches, frame_of(f"{name_of(world, True)}/FRD")))}
    if not found:
        return None
    most = max(len(streams) for streams in found.values())
    names = [name for name, streams in found.items() if len(streams) == most]
    name = names[0] if len(names) == 1 else _by_yaw(context, names)
    clear = sum(sign < 0 or m.order[i] != i for s in found[name] for m in matches[s] for i, sign in enumerate(m.sign))
    if clear < 2 or found[name] == ("imu",):
        return None
    if not set(found[name]) & {"imu", "attitude", "attitude_qw", "pid"}:
        return SharedFrame(frame_of(name), found[name], "the poses show that z of the tracked world is up")
    return SharedFrame(frame_of(f"{name}/FRD"), found[name], "the poses show that z of the tracked world is up, and "
                                                             "heights and turning rates point the other way")


def _by_yaw(context: Context, names: list[str]) -> str:
    """Of worlds that differ by their heading, that in which the estimated yaw is the tracked one."""
    attitude, poses = estimated_attitude(context), context.once(posed)
    if attitude is None or poses is None:
        return names[0]
    at = np.clip(np.searchsorted(poses.time_s, attitude.time_s), 0, len(poses) - 1)
    tracked = poses["qx", "qy", "qz", "qw"][at]

    def apart(name: str) -> float:
        turned = in_our_axes(attitude, frame_of(f"{name}/FRD"))["qx", "qy", "qz", "qw"]
        return float(np.nanmedian(so3.geodesic_angle(turned, tracked)))

    return min(names, key=apart)


def _turned_so(match: AxisUnitMatch, axes: Frame) -> bool:
    """Whether every clear axis of a match looks like that of a stream in ``axes``."""
    if match.quantities == EULER:
        if axes.world[2, 2] > -1.0 or not np.array_equal(axes.body, np.diag([1.0, -1.0, -1.0])):
            return False
        turn = axes.body
    else:
        turn = (axes.world if match.quantities[0] in ("x", "vx", "ax") else axes.body).T
    return all(sign in (0, turn[i, order]) for i, (order, sign) in enumerate(zip(match.order, match.sign, strict=True)))


def _by_estimate(context: Context) -> SharedFrame | None:
    attitude, place = estimated_attitude(context), context.once(usable_streams).get("estimator")
    if attitude is None or place is None or not all(q in place for q in PLACE) or len(attitude) < 20 \
            or height_alone(place):
        return None
    quaternion = so3.interpolate(attitude.time_s, attitude["qx", "qy", "qz", "qw"], place.time_s)
    known = np.isfinite(quaternion).all(axis=1) & np.isfinite(place[PLACE]).all(axis=1)
    time_s, position = place.time_s[known], place[PLACE][known]
    found = tilts_of(time_s, position, quaternion[known]) if known.sum() > 20 else {}
    usual = found.get((UP, UP))
    if usual is None or usual.flies:
        return None
    ground = ground_axes_of(time_s, position)
    if not ground and np.quantile(position[:, 2], ALMOST_ALL) > 0.0:
        found.pop((DOWN, DOWN), None)
    world, body, why = _axes(found, usual, ground)
    if not why:
        return None
    axes = frame_of(f"{WORLDS[world]}/{BODIES[body]}")
    streams = tuple(name for name in FRAMED if name in context.flight and _belongs(context, name, attitude, axes))
    return SharedFrame(axes, streams, why)


def height_alone(place: Stream) -> bool:
    """Whether the estimate climbs where its height falls: one of the two columns is negated, and no frame is turned."""
    if "vz" not in place or len(place) < 20:
        return False
    known = np.isfinite(place["z", "vz"]).all(axis=1)
    height, climb = np.diff(place["z"][known]), place["vz"][known][1:]
    return bool(height @ climb < -CLEAR * np.linalg.norm(height) * np.linalg.norm(climb))


def _axes(found: dict[tuple[Axis, Axis], Tilt], usual: Tilt, ground: dict[Axis, float]) -> tuple[Axis, Axis, str]:
    """World, body and evidence; the evidence is empty where nothing shows other axes."""
    better = max(OTHER_FOLLOWS, usual.follows + CLEARLY if usual.upright > UPRIGHT else 0.0)
    flying = {axes: tilt for axes, tilt in found.items()
              if tilt.flies and tilt.follows > better and (not ground or axes[0] in ground)}
    if flying:
        world, body = max(flying, key=lambda axes: flying[axes].follows)
        return world, body, (f"the estimate speeds up towards its tilt if {NAMES[world]} of the world and "
                             f"{NAMES[body]} of the body point up (correlation {flying[world, body].follows:+.2f}, "
                             f"else {usual.follows:+.2f})")
    steep = usual.upright > 0.0 and usual.follows < -OTHER_FOLLOWS
    if set(ground) == {DOWN} and (steep or (usual.upright > UPRIGHT and usual.follows < FOLLOWS)):
        return DOWN, DOWN, (f"the estimated height goes {ground[DOWN]:.2f} m below the place where the vehicle rested, "
                            "and the attitude is upright there")
    return UP, UP, ""


def _belongs(context: Context, name: str, attitude: Stream, axes: Frame) -> bool:
    """Whether a stream does not contradict the axes: gravity, the gyro against the attitude, heights against those of
    the estimate."""
    streams = context.once(usable_streams)
    stream = streams.get(name)
    if stream is None or not len(stream):
        return False
    if name == "imu":
        gravity = context.once(gravity_axis)
        if gravity is not None:
            return bool(axes.body[2, gravity.axis] * gravity.sign > 0.0)
        return all(q in stream for q in GYRO) and turns_as(stream, attitude)
    if name == "setpoint" and "z" in stream and len(stream) > 20:
        flown = streams["estimator"]
        wanted = np.interp(flown.time_s, stream.time_s, stream["z"])
        return bool(np.nansum((wanted - np.nanmean(wanted)) * (flown["z"] - np.nanmean(flown["z"]))) >= 0.0)
    return name in ("estimator", "estimator_acc", "setpoint") or all(
        q in stream for q in (EULER if "roll" in stream else ("qx", "qy", "qz", "qw")))


def turns_as(imu: Stream, attitude: Stream) -> bool:
    """Whether the gyro turns as the estimated attitude about y and z."""
    middle, rates = rates_of(attitude)
    gyro = np.stack([np.interp(middle, imu.time_s, imu[q]) for q in GYRO], axis=1)
    known = np.isfinite(gyro).all(axis=1) & np.isfinite(rates).all(axis=1)
    return bool(np.all(np.sum((gyro * rates)[known], axis=0)[1:] > 0.0))
