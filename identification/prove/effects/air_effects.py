"""What the air and constant forces do."""

from dataclasses import replace
from typing import ClassVar

import numpy as np

from ..airframe import Airframe
from .effect import Air, Effect, Parameters, near, turned

LOWEST_RADII = 0.5


class AngularDamping(Effect):
    """Air brakes turning."""

    name = "angular_damping"
    parameters = ("d_r",)
    sizes: ClassVar = {"small": "a rate left alone would fall to 1/e in 1 s", "medium": "in 0.3 s", "large": "in 0.1 s"}
    wants = ("fast", "turning", "lateral")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        rate = near(rng, {"small": 1.0, "medium": 3.3, "large": 10.0}[size])
        return {"d_r": [float(f"{rate * j:.4g}") for j in airframe.inertia_kg_m2]}

    def moment(self, air: Air) -> np.ndarray:
        return np.asarray(-self.a["d_r"] * air.rate)


class DragLinear(Effect):
    """More drag than the simulator believes, in proportion to air speed; or drag where it believes in none."""

    name = "drag_linear"
    parameters = ("d",)
    sizes: ClassVar = {"small": "0.15 m/s^2 at 1 m/s",
                        "medium": "0.35 m/s^2 at 1 m/s, what the real vehicle has in all",
                        "large": "0.8 m/s^2 at 1 m/s"}
    wants = ("fast", "lateral", "turning")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        rate = {"small": 0.15, "medium": 0.35, "large": 0.80}[size]
        absent = bool(rng.uniform() < 0.4)
        before = (0.0, 0.0, 0.0) if absent else airframe.drag_N_s_m
        more = [near(rng, rate * share) * airframe.mass_kg for share in (1.0, 1.0, 0.4)]
        return {"d": [float(f"{b + m:.4g}") for b, m in zip(before, more, strict=True)], "absent": absent}

    @staticmethod
    def change(airframe: Airframe, p: Parameters) -> Airframe:
        return replace(airframe, drag_N_s_m=tuple(p["d"]))


class DragQuadratic(Effect):
    """Drag with the square of the air speed, on top of what the simulator knows."""

    name = "drag_quadratic"
    parameters = ("q",)
    sizes: ClassVar = {"small": "0.15 m/s^2 at 1 m/s", "medium": "0.35 m/s^2 at 1 m/s", "large": "0.8 m/s^2 at 1 m/s"}
    wants = ("fast", "lateral", "slow", "turning")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        rate = {"small": 0.15, "medium": 0.35, "large": 0.80}[size]
        return {"q": [float(f"{near(rng, rate * share) * airframe.mass_kg:.4g}") for share in (1.0, 1.0, 0.5)]}

    def force(self, air: Air) -> np.ndarray:
        return np.asarray(-self.a["q"] * np.abs(air.air_b) * air.air_b)


class DragRotor(Effect):
    """Drag of turning blades: in proportion to air speed and to the sum of the rotor speeds."""

    name = "drag_rotor"
    parameters = ("d",)
    sizes: ClassVar = {"small": "0.15 m/s^2 at 1 m/s in hover", "medium": "0.35 m/s^2", "large": "0.8 m/s^2"}
    wants = ("fast", "lateral", "vertical", "turning")
    twins = ("drag_linear",)

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        hover = 4.0 * (airframe.mass_kg * 9.81 / 4.0 / airframe.k_f_N_s2) ** 0.5
        rate = {"small": 0.15, "medium": 0.35, "large": 0.80}[size]
        return {"d": [float(f"{near(rng, rate * share) * airframe.mass_kg / hover:.4g}") for share in (1.0, 1.0, 0.2)]}

    def force(self, air: Air) -> np.ndarray:
        return np.asarray(-air.rotor.sum(axis=0) * self.a["d"] * air.air_b)


class DragTorque(Effect):
    """Air against the rotors, which lie off the centre of mass, turns the vehicle up or down as it flies sideways."""

    name = "drag_torque"
    parameters = ("c",)
    sizes: ClassVar = {"small": "2 rad/s^2 at 1 m/s", "medium": "5 rad/s^2, what the real vehicle has in all",
             "large": "12 rad/s^2 at 1 m/s"}
    wants = ("fast", "lateral", "turning")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        more = -near(rng, {"small": 3.6e-5, "medium": 9e-5, "large": 2.2e-4}[size])
        absent = bool(rng.uniform() < 0.4)
        return {"c": float(f"{more + (0.0 if absent else airframe.drag_torque_N_s):.4g}"), "absent": absent}

    @staticmethod
    def change(airframe: Airframe, p: Parameters) -> Airframe:
        return replace(airframe, drag_torque_N_s=p["c"])


class Inflow(Effect):
    """Climbing takes thrust, flying sideways gives some."""

    name = "inflow"
    parameters = ("k_z", "k_h")
    sizes: ClassVar = {"small": "2 % of thrust per m/s of climb, 0.5 % at 1 m/s sideways", "medium": "5 % and 1.5 %",
             "large": "12 % and 4 %"}
    wants = ("vertical", "fast", "lateral")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        k_z, k_h = {"small": (0.02, 0.005), "medium": (0.05, 0.015), "large": (0.12, 0.04)}[size]
        return {"k_z": near(rng, k_z), "k_h": near(rng, k_h)}

    def thrust(self, thrust_N: np.ndarray, air: Air) -> np.ndarray:
        x, y, z = air.velocity_b
        return np.asarray((1.0 - self.a["k_z"] * z + self.a["k_h"] * (x * x + y * y)) * thrust_N)


class GroundEffect(Effect):
    """More thrust near the ground, z = 0 of the room (Cheeseman and Bennett 1955), for four rotors and a body."""

    name = "ground_effect"
    parameters = ("rho", "R")
    sizes: ClassVar = {"small": "1.5 % more thrust 0.15 m above the ground", "medium": "3.5 %", "large": "7 %"}
    wants = ("low", "vertical")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        gain = near(rng, {"small": 0.015, "medium": 0.035, "large": 0.07}[size])
        rho = near(rng, 2.5)
        radius = 4.0 * 0.15 * float(np.sqrt((1.0 - 1.0 / (1.0 + gain)) / rho))  # of the air cushion, not of a blade
        return {"rho": rho, "R": float(f"{radius:.4g}")}

    def thrust(self, thrust_N: np.ndarray, air: Air) -> np.ndarray:
        height = np.maximum(air.position[2], LOWEST_RADII * self.a["R"])
        return np.asarray(thrust_N / (1.0 - self.a["rho"] * (self.a["R"] / (4.0 * height)) ** 2))


class Wind(Effect):
    """The air of the room moves."""

    name = "wind"
    parameters = ("w_m_s",)
    sizes: ClassVar = {"small": "0.15 m/s, a draught", "medium": "0.4 m/s", "large": "1.0 m/s, a fan"}
    wants = ("turning", "fast", "lateral")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        speed = near(rng, {"small": 0.15, "medium": 0.4, "large": 1.0}[size])
        return {"w_m_s": [float(f"{x:.4g}") for x in turned(rng, speed, 0.2)]}

    def wind(self) -> np.ndarray:
        return self.a["w_m_s"]


class ForceWorld(Effect):
    """A constant force in the world: a cable's pull, a magnet far away."""

    name = "force_world"
    parameters = ("f_N",)
    sizes: ClassVar = {"small": "0.06 m/s^2 on this mass", "medium": "0.15 m/s^2", "large": "0.4 m/s^2"}
    wants = ("turning", "lateral")

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        strength = near(rng, {"small": 0.06, "medium": 0.15, "large": 0.4}[size]) * airframe.mass_kg
        return {"f_N": [float(f"{x:.4g}") for x in turned(rng, strength)]}

    def push(self, air: Air) -> np.ndarray:
        return np.broadcast_to(self.a["f_N"], air.position.shape)
