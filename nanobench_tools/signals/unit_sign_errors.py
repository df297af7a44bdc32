"""Wrong units of a flight, each once, the streams they concern, and which way gravity lies in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..settings import number
from .axis_unit_matching import AxisUnitMatch, wrong_matches
from .context import Context
from .crashes import crash_of
from .dropouts import alive_until
from .path_sizes import wrong_paths
from .plausible_ranges import WrongUnit, wrong_ranges
from .usable_rows import usable_streams

GRAVITY_SHARE = number("audit.unit_sign_errors.gravity_share")
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


def wrong_units(context: Context) -> list[WrongUnit]:
    """Ranges first; faults that they explain are not reported again by the path and the comparison. Gravity alone
    decides the unit of the accelerometer: derivatives of noisy poses are larger than any acceleration."""
    found = list(context.once(wrong_ranges))
    reported = {(w.stream, q) for w in found for q in w.quantities}
    found += [w for w in context.once(wrong_paths) if not reported & {(w.stream, q) for q in w.quantities}]
    reported = {(w.stream, q) for w in found for q in w.quantities}
    for verdict in context.once(wrong_matches):
        if verdict.factor == 1.0 or verdict.quantities == ACC or any((verdict.stream, q) in reported
                                                                     for q in verdict.quantities):
            continue
        found.append(
            WrongUnit(verdict.stream, verdict.quantities, verdict.factor,
                      f"{', '.join(verdict.quantities)} of {verdict.stream} are {verdict.factor:.4g} times what the "
                      f"{against(verdict)} predicts{_named(verdict)}")
        )
    return found


def distorted_streams(context: Context) -> set[str]:
    """Streams whose values are in wrong units: sizes mean nothing there."""
    return {w.stream for w in context.once(wrong_units)}


def against(verdict: AxisUnitMatch) -> str:
    return (
        "vehicle's own streams"
        if verdict.stream == "mocap" and verdict.quantities[0] in ("px", "qx")
        else "motion capture"
    )


def _named(verdict: AxisUnitMatch) -> str:
    return f" ({verdict.factor_name})" if verdict.factor_name else ""
