"""The frame that the motion capture tracks is not the vehicle's: markers were registered while the vehicle was not
level.

Thrust, IMU and motors keep their axes; the tracked quaternion is turned. The onboard estimate is not: it follows the
IMU. Acts in the logging chain, not in the air.
"""

from typing import ClassVar

import numpy as np

from nanobench_tools import so3

from ..airframe import Airframe
from .effect import Effect, Parameters, near


class FrameTilt(Effect):
    name = "frame_tilt"
    parameters = ("roll_rad", "pitch_rad")
    sizes: ClassVar = {"small": "0.35 deg", "medium": "1 deg", "large": "2.5 deg"}
    wants = ("turning", "lateral")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        angle = np.radians(near(rng, {"small": 0.35, "medium": 1.0, "large": 2.5}[size]))
        way = rng.uniform(0.0, 2.0 * np.pi)
        return {"roll_rad": float(f"{angle * np.cos(way):.4g}"), "pitch_rad": float(f"{angle * np.sin(way):.4g}")}

    @staticmethod
    def tracked(p: Parameters) -> tuple[float, float, float]:
        """Rotation vector from the vehicle to the tracked frame: the reverse of Rot_x(roll) Rot_y(pitch)."""
        roll, pitch = np.array([p["roll_rad"], 0.0, 0.0]), np.array([0.0, p["pitch_rad"], 0.0])
        thrust = so3.multiply(so3.exp(roll), so3.exp(pitch))
        x, y, z = (float(v) for v in so3.log(so3.conjugate(thrust)))
        return x, y, z
