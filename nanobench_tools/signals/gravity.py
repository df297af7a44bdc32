"""Which way gravity lies in the body, by the accelerometer."""

from dataclasses import dataclass

import numpy as np

from ..settings import number
from .context import Context
from .crashes import crash_of
from .dropouts import alive_until
from .usable_rows import usable_streams

GRAVITY_SHARE = number("audit.gravity.gravity_share")
ACC = ("acc_x", "acc_y", "acc_z")


@dataclass(frozen=True)
class Gravity:
    """Body axis (0, 1, 2) along which the mean specific force lies, and its sign."""

    axis: int
    sign: int
    mean: tuple[float, ...]


def gravity_axis(context: Context) -> Gravity | None:
    """None without an accelerometer, or when no axis has most of the mean."""
    stream = context.once(usable_streams).get("imu")
    if stream is None or not all(q in stream.quantities for q in ACC):
        return None
    crash = context.once(crash_of)
    end = context.once(alive_until)["imu"] if crash is None else min(crash.start_s, context.once(alive_until)["imu"])
    values = stream[ACC][stream.time_s <= end]
    values = values[np.isfinite(values).all(axis=1)]
    if len(values) < 100:
        return None
    mean = np.mean(values, axis=0)
    size = np.linalg.norm(mean)
    axis = int(np.argmax(np.abs(mean)))
    if not size > 0.0 or abs(mean[axis]) < GRAVITY_SHARE * size:
        return None
    return Gravity(axis, int(np.sign(mean[axis])), tuple(float(m) for m in mean))
