"""Set-points of a drafted map: what a mask has the vehicle ignore, and files that are named after a set-point."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from ..sources.column_names import bare
from .draft import Draft

LOCAL_NED = 1
"""``MAV_FRAME`` of a set-point in the axes of the world. Others are offsets, or turn with the vehicle."""
IGNORED = {"x": 1, "y": 2, "z": 4, "yaw": 1024}
"""Bit of MAVLink's ``POSITION_TARGET_TYPEMASK`` that has the vehicle ignore a set-point."""
NAMED_SET_POINT = re.compile(r"(?i)(^|[^a-z])set_?points?([^a-z]|$)")
POSE = ("px", "py", "pz", "qx", "qy", "qz", "qw", "vx", "vy", "vz", "x", "y", "z")


def judge_targets(draft: Draft, values: Mapping[str, np.ndarray], file: str) -> None:
    """Leaves out set-points that the vehicle ignores, and asks about those in other axes than the world's."""
    masks = {bare(column).rpartition(".")[2].rpartition("/")[2]: cells for column, cells in values.items()}
    keys = draft.columns("setpoint", tuple(IGNORED))
    if (frames := masks.get("coordinate_frame")) is not None and keys:
        others = sorted({int(f) for f in frames[np.isfinite(frames)]} - {LOCAL_NED})
        if others:
            draft.ask(keys, f"set-points in MAV_FRAME {', '.join(map(str, others))}, which are not the axes of the "
                      f"world; keep the rows in MAV_FRAME {LOCAL_NED}")
            return
    if (mask := masks.get("type_mask")) is not None:
        bits = np.nan_to_num(mask, nan=0.0).astype(np.int64)
        for key in keys:
            ignored = (bits & IGNORED[key[1]]) > 0
            if ignored.all():
                draft.unknown[draft.mapped.pop(key).column] = "a set-point that its mask has the vehicle ignore"
            elif ignored.any():
                draft.ask([key], f"in {ignored.sum()} of {len(ignored)} rows its mask has the vehicle ignore this "
                          "set-point; keep the others")
    poses = [k for s in ("mocap", "estimator") for k in draft.columns(s, POSE)]
    if NAMED_SET_POINT.search(file) and not draft.columns("setpoint", tuple(IGNORED)):
        draft.ask(poses, "the file is named after a set-point: is this commanded or measured? write it in "
                  "[streams.setpoint] as x, y, z, or rename the file")
