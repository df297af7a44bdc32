"""What differs in mass, its distribution, the rotors' moments and the tracked frame."""

from dataclasses import replace
from typing import ClassVar

import numpy as np

from nanobench_tools import so3

from ..airframe import SPIN, Airframe
from .effect import Air, Effect, Parameters, either, near


class Mass(Effect):
    """Another mass than the simulator's, at the place of the centre of mass: inertia stays."""

    name = "mass"
    parameters = ("m",)
    sizes: ClassVar = {"small": "2 % of the weight: 0.8 g, a marker set", "medium": "5 %: 2 g, a deck",
                        "large": "12 %: 4.7 g"}
    wants = ("lateral", "vertical")
    twins = ("thrust_scale",)

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        share = near(rng, {"small": 0.02, "medium": 0.05, "large": 0.12}[size]) * either(rng)
        return {"m": float(f"{airframe.mass_kg * (1.0 + share):.5g}")}

    @staticmethod
    def change(airframe: Airframe, p: Parameters) -> Airframe:
        return replace(airframe, mass_kg=p["m"])


class ComOffset(Effect):
    """The centre of mass is offset from the point between the motors: forces turn the vehicle about it."""

    name = "com_offset"
    parameters = ("r_m",)
    sizes: ClassVar = {"small": "0.5 mm, a battery not quite in its place", "medium": "1.5 mm", "large": "4 mm"}
    wants = ("lateral", "vertical", "turning")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        length, way = near(rng, {"small": 5e-4, "medium": 1.5e-3, "large": 4e-3}[size]), rng.uniform(0.0, 2 * np.pi)
        return {"r_m": [float(f"{length * np.cos(way):.4g}"), float(f"{length * np.sin(way):.4g}"), 0.0]}

    def moment(self, air: Air) -> np.ndarray:
        (x, y, z), (fx, fy, fz) = self.a["r_m"], air.force_b
        return -np.stack([y * fz - z * fy, z * fx - x * fz, x * fy - y * fx])


class Inertia(Effect):
    """Another inertia about roll and pitch than the simulator's table. Yaw stays: only k_m / J_z could be seen."""

    name = "inertia"
    parameters = ("inertia_kg_m2",)
    sizes: ClassVar = {"small": "15 % about one axis or both", "medium": "30 %", "large": "60 % (or 40 % less)"}
    wants = ("lateral", "fast")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        way = either(rng)
        share = near(rng, {"small": 0.15, "medium": 0.30, "large": 0.60 if way > 0.0 else 0.40}[size])
        axes = ((True, True), (True, False), (False, True))[int(rng.integers(3))]
        j = airframe.inertia_kg_m2
        new = [float(f"{x * (1.0 + way * share * on):.5g}") for x, on in zip(j, (*axes, False), strict=True)]
        return {"inertia_kg_m2": new}

    @staticmethod
    def change(airframe: Airframe, p: Parameters) -> Airframe:
        return replace(airframe, inertia_kg_m2=tuple(p["inertia_kg_m2"]))


class YawTorque(Effect):
    """The rotors' drag turns the vehicle more or less than the simulator believes."""

    name = "yaw_torque"
    parameters = ("k_m",)
    sizes: ClassVar = {"small": "20 % of k_m", "medium": "35 %", "large": "60 %"}
    wants = ("turning", "lateral")
    twins = ("inertia",)

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        share = near(rng, {"small": 0.20, "medium": 0.35, "large": 0.60}[size]) * either(rng)
        return {"k_m": float(f"{airframe.yaw_arm_m * (1.0 + share):.5g}")}

    @staticmethod
    def change(airframe: Airframe, p: Parameters) -> Airframe:
        return replace(airframe, yaw_arm_m=p["k_m"])


class RotorGyro(Effect):
    """Rotors resist the turning of their axes. Only the sum over both senses of rotation counts.

    It is small in steady flight."""

    name = "rotor_gyro"
    parameters = ("J_r",)
    sizes: ClassVar = {"small": "2e-8 kg m^2, a real propeller of this size", "medium": "7e-8",
                        "large": "2e-7"}
    wants = ("spinning", "fast", "turning")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        return {"J_r": -near(rng, {"small": 2e-8, "medium": 7e-8, "large": 2e-7}[size])}

    def moment(self, air: Air) -> np.ndarray:
        momentum = self.a["J_r"] * sum(s * omega for s, omega in zip(SPIN, air.rotor, strict=True))
        x, y, _ = air.rate
        return np.stack([-y * momentum, x * momentum, np.zeros_like(momentum)])


class FrameTilt(Effect):
    """The frame that the motion capture tracks is not the vehicle's: markers were registered while the vehicle was not
    level.

    Thrust, IMU and motors keep their axes; the tracked quaternion is turned. The onboard estimate is not: it follows
    the IMU. Acts in the logging chain, not in the air.
    """

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
