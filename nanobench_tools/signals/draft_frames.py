"""Frames of a drafted map that the flight shows: which axes of its streams point up, judged as the audit does."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .. import so3
from ..errors import UsageError
from ..flight import Flight, Provenance, Stream, make_stream
from ..sources.axes import EULER, frame_of, in_our_axes, name_of
from . import column_evidence as evidence
from .context import Context
from .draft import PITCH_ASSUMED, Draft
from .flown_axes import UP, ground_axes, tilts, tilts_of
from .gravity import ACC
from .held_poses import ROTATION
from .pose_frame import pose_frame
from .shared_frame import GYRO, SharedFrame, shared_frame, turns_as
from .stream_frames import pose_turn, stream_turns, unexplained_gravity
from .tilt_heading import other_height
from .turning_doubt import turning_doubt, turns_otherwise

STREAMS = ("mocap", "imu", "estimator", "estimator_acc", "setpoint", "pid", "attitude", "attitude_qw")
ROTATED = ("mocap", "attitude", "attitude_qw")
"""Streams of an attitude, which has axes of a world and of a body."""


def judge_frames(draft: Draft, values: Mapping[str, np.ndarray], time_s: np.ndarray) -> None:
    """Names the frame of every stream in turned axes where the flight shows it, else asks or notes what to check.

    ``likely`` frames of the draft count where the flight shows none."""
    streams = _streams(draft, values, time_s)
    upright = False
    context = Context(Flight("draft", streams, {}, Provenance("draft", "", "table")))
    if streams and (doubt := context.once(turning_doubt)) is not None:
        columns = list(dict.fromkeys(q for change in doubt.changes for q in change))
        draft.ask([*draft.columns("imu", GYRO), *draft.columns(doubt.stream, columns)],
                  f"the gyro turns otherwise than the attitude; which is negated, or changed places"
                  f"{f' ({doubt.why})' * bool(doubt.why)}? write sign = -1 there, or exchange the columns")
    if streams and (shared := context.once(shared_frame)) is not None:
        _share(draft, shared)
    if "mocap" in streams:
        world, body, why = context.once(pose_turn)
        if why and context.once(pose_frame).world is not None and not context.once(pose_frame).foreign_rad:
            _turn(draft, "mocap", world, body, why)
        for turn in context.once(stream_turns):
            if turn.stream != "mocap":
                _turn(draft, turn.stream, turn.turn, turn.turn, turn.why)
        usual = context.once(tilts)["x, y, z, w"].get((UP, UP))
        upright = (usual is not None and usual.flies) and context.once(other_height) is None
        upright |= UP in context.once(ground_axes)
    for stream, frame in draft.likely.items():
        draft.frames.setdefault(stream, frame)
    framed = _streams(draft, values, time_s)
    _attitude(draft, framed)
    if draft.frames and turns_otherwise(Context(Flight("draft", framed, {}, Provenance("draft", "", "table")))):
        draft.ask([*draft.columns("imu", GYRO), *draft.columns("mocap", ROTATION)],
                  "in no axes of whole streams does the gyro turn as the attitude; is one of these another column, or "
                  "negated?")
    gravity = context.once(unexplained_gravity) if streams and "imu" not in draft.frames else None
    if gravity is not None and (gravity.axis, gravity.sign) == (2, -1):
        draft.ask(draft.columns("imu", ACC), "gravity lies along -z, but other streams have z up. Does the sensor give "
                  "gravity, not the specific force? If so, write sign = -1 at all three, else at z alone")
    _down(draft, values, upright)


def _streams(draft: Draft, values: Mapping[str, np.ndarray], time_s: np.ndarray) -> dict[str, Stream]:
    """The drafted streams in SI and in the axes of their frames, over rows whose time grows."""
    known = np.isfinite(time_s)
    known[known] = np.diff(np.maximum.accumulate(time_s[known]), prepend=-np.inf) > 0.0
    found = {}
    for name in STREAMS:
        keys = [key for key in draft.mapped if key[0] == name]
        if not keys or known.sum() < 4 * evidence.WINDOW:
            continue
        stream = make_stream(name, time_s[known], draft.si(keys, values)[known], [q for _, q in keys])
        try:
            found[name] = in_our_axes(stream, frame_of(draft.frames[name])) if name in draft.frames else stream
        except UsageError:
            continue
    return found


def _turn(draft: Draft, stream: str, world: np.ndarray, body: np.ndarray, why: str) -> None:
    """Notes the frame that ``world`` and ``body`` (3, 3) take to ours."""
    if stream in draft.frames or stream not in {s for s, _ in draft.mapped}:
        return
    rotated = any((stream, q) in draft.mapped for q in ("qw", "roll"))
    axes = name_of(body, False) if stream == "imu" else name_of(world, True)
    axes += f"/{name_of(body, False)}" if rotated and stream in ROTATED else ""
    draft.frames[stream] = axes
    alike = axes[1] == "U" and not draft.columns("imu", GYRO)  # which turns the other way in a mirrored world
    turned = " with qx and qy" * ((stream, "qw") in draft.mapped)
    mirrored = f"; those of Unity are left-handed and look alike: negate z{turned} there" * alike
    draft.notes.append(f"{stream}: in {axes} axes, turned to z up and x forward, since {why}{mirrored}")


def _share(draft: Draft, shared: SharedFrame) -> None:
    """Notes the axes that several streams share."""
    mapped = {stream for stream, _ in draft.mapped}
    streams = [stream for stream in shared.streams if stream in mapped and stream not in draft.frames]
    for stream in streams:
        parts = shared.axes.name.split("/")
        rotated = any((stream, q) in draft.mapped for q in ("qw", "roll"))
        draft.frames[stream] = parts[-1] if stream == "imu" else shared.axes.name if rotated else parts[0]
    if "attitude" in streams:
        draft.notes[:] = [n for n in draft.notes if PITCH_ASSUMED not in n]
    if streams:
        draft.notes.append(f"{', '.join(streams)}: in {shared.axes.name} axes, turned to z up and x forward, since "
                           f"{shared.why}")


def _attitude(draft: Draft, streams: dict[str, Stream]) -> None:
    """Euler angles with a position in axes with z down: in those axes and FRD, or in ours. The tilt decides.

    The IMU that turns with the angles follows them. Without enough tilt they are a question."""
    place = next((s for s in ("mocap", "estimator") if s in streams and draft.frames.get(s, "")[2:3] == "D"), None)
    angles = streams.get("attitude")
    if place is None or angles is None or "attitude" in draft.frames or not all(q in angles for q in EULER):
        return
    names = ("px", "py", "pz") if place == "mocap" else ("x", "y", "z")
    if not all(q in streams[place] for q in names):
        return
    frame = f"{draft.frames[place][:3]}/FRD"
    flies = {}
    for turned in ("", frame):
        read = in_our_axes(angles, frame_of(turned)) if turned else angles
        known = np.isfinite(read[EULER]).all(axis=1) & np.isfinite(streams[place][names]).all(axis=1)
        tilt = tilts_of(read.time_s[known], streams[place][names][known],
                        so3.from_euler_zyx(*read[EULER][known].T)).get((UP, UP)) if known.sum() > 20 else None
        flies[turned] = tilt is not None and tilt.flies
    if flies[""] == flies[frame]:
        draft.ask([("attitude", q) for q in EULER],
                  f"the position is in {draft.frames[place]}. Are the angles, too, with the body in FRD? If so, write "
                  f'frame = "{frame}" in [streams.attitude]')
        return
    draft.notes[:] = [n for n in draft.notes if PITCH_ASSUMED not in n]
    if flies[""]:
        return
    draft.frames["attitude"] = frame
    shared = ["attitude"]
    turning = make_stream("attitude_qw", angles.time_s, so3.from_euler_zyx(*angles[EULER].T), ("qx", "qy", "qz", "qw"))
    if "imu" in streams and "imu" not in draft.frames and all(q in streams["imu"] for q in GYRO) and turns_as(
            streams["imu"], turning):
        draft.frames["imu"] = "FRD"
        shared.append("imu")
    draft.notes.append(f"{', '.join(shared)}: in {frame} axes, since the vehicle then speeds up towards its tilt")


def _down(draft: Draft, values: Mapping[str, np.ndarray], upright: bool) -> None:
    """A height that only falls in flight: its axis points down. A flight whose height is y. ``upright``: the flight
    shows that z of the motion capture is up."""
    heights = [draft.mapped[k].column for k in draft.columns("mocap", ("py", "pz"))]
    if len(heights) == 2 and not upright and "mocap" not in draft.frames and evidence.falls_in_flight(
            -values[heights[0]]) and not any(evidence.falls_in_flight(s * values[heights[1]]) for s in (1.0, -1.0)):
        draft.ask(draft.columns("mocap", ("px", "py", "pz")),
                  f"{heights[0]} rises and returns as a height does, {heights[1]} does not: is y up? If so, frame = "
                  '"EUS/FUR" in [streams.mocap], "ENU" if z is up, or exchange the two columns')
    attitude = any((stream, q) in draft.mapped for stream in ROTATED for q in ("qw", "roll"))
    for stream, name in (("mocap", "pz"), ("estimator", "z"), ("setpoint", "z")):
        drafted = draft.mapped.get((stream, name))
        if drafted is None or stream in draft.frames or drafted.sign < 0 or (stream == "mocap" and upright):
            continue
        height = values[drafted.column][np.isfinite(values[drafted.column])]
        falls = evidence.falls_in_flight(height)
        if not falls and not (len(height) and height.max() < 0.0):
            continue
        what = f"{drafted.column} {'falls in flight' if falls else 'is below 0 in every row'}"
        keys = draft.columns(stream, ("px", "py", "pz", "x", "y", "z"))
        if falls and not attitude and len(keys) == 3:
            draft.frames[stream] = "NED"
            draft.notes.append(f"{stream}: in NED axes, turned to z up, since {what}")
        else:
            draft.ask(keys, f'{what}: does z point down? If so, frame = "NED" in [streams.{stream}] ("NED/FRD" with an '
                            'attitude), "ENU" if it does not, or sign = -1 at the height alone')
