"""What differs between flights of one vehicle, as directions through the parameters: a battery further left, a weaker
propeller, a tracker that was put on askew."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from .solve import Nuisance


def _motors(*weights: float) -> dict[str, float]:
    return {f"motor_imbalance.g[{i}]": w for i, w in enumerate(weights)}


SCALE = Nuisance("thrust", {"thrust_scale.s": 1.0}, 0.03, "1", "thrust over what the map says")
TRIMS = (Nuisance("trim_roll", _motors(-1.0, -1.0, 1.0, 1.0), 0.03, "1", "motors left against right"),
         Nuisance("trim_pitch", _motors(-1.0, 1.0, 1.0, -1.0), 0.03, "1", "motors at the back against the front"),
         Nuisance("trim_yaw", _motors(-1.0, 1.0, -1.0, 1.0), 0.03, "1", "motors of one spin against the others"))
TILT = (Nuisance("tilt_roll", {"frame_tilt.roll_rad": 1.0}, 0.02, "rad", "thrust axis against the attitude, about x"),
        Nuisance("tilt_pitch", {"frame_tilt.pitch_rad": 1.0}, 0.02, "rad", "thrust axis against the attitude, about y"))
"""Spreads: thrust over its map differs by 3 % between flights and a motor by some per cent, frames by about a degree
(NanoBench recordings)."""

NEUTRAL: dict[str, dict[str, Any]] = {"thrust_scale": {"s": 1.0}, "motor_imbalance": {"g": [1.0] * 4},
           "frame_tilt": {"roll_rad": 0.0, "pitch_rad": 0.0}}
"""The terms the directions go through, where they change nothing."""


def terms_of(nuisances: Sequence[Nuisance]) -> dict[str, dict]:
    """The terms a model needs to have these nuisances."""
    wanted = {name.partition(".")[0] for n in nuisances for name in n.direction}
    return {term: values for term, values in NEUTRAL.items() if term in wanted}
