"""A second engine: RotorPy's own multirotor (Folk, Paulos, Kumar 2023) in place of the practice vehicle's equations.

RotorPy gives the forces and moments of every rotor with its drag, flapping and lag of the rotor speed. It includes the
wind and the motion of the body. Battery, commanded thrust, ground, sensors, controllers and room are the practice
ones. What RotorPy's numbers are in terms of a simulator, with S the sum of the rotor speeds in hover:

    k_eta -> thrust_rpm k_f            k_m / k_eta -> yaw_torque k_m            tau_m -> motor_lag, both ways

    k_d, k_d, k_z -> drag_rotor d      k_flap S -> drag_torque c                wind -> wind

    S a^2 (k_z, k_z, 2 k_d) -> angular_damping, because the drag acts at the rotors (a: half the distance of two)

Two small differences have no term: RotorPy's rotors lag in speed, not in thrust; the last two lines hold at hover
speed. Two effects have no exact term and are switched off. These are its parasitic drag (norm of the velocity times
each component) and its translational lift (in newton, at any rotor speed).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from nanobench_tools.errors import MissingExtraError
from nanobench_tools.practice.rigid_bodies import POSITION, QUATERNION, RATE, THRUST, VELOCITY, rotation_columns
from nanobench_tools.practice.vehicle_parameters import Vehicles

from .airframe import ARM_M, POSITIONS_M, SPIN, Airframe
from .case_kinds import CaseSpec, Hidden
from .effects import EFFECTS
from .engine import Acting, Engine

SPEED_MAX_RAD_S = 5000.0
MOST_FLIGHTS = 4
"""RotorPy's equations take one vehicle at a time."""
OWN = ("wind", "drag_rotor", "com_offset", "angular_damping")
"""Effects that RotorPy has itself, so that their hooks are not used."""
EFFECTS_HERE = ("thrust_voltage", "thrust_scale", "mass", "motor_lag", "command_delay", "motor_imbalance", "com_offset",
                "inertia", "yaw_torque", "drag_torque", "drag_rotor", "wind", "force_world", "frame_tilt", "jet",
                "heating", "periodic", "tether", "dropout", "gusts")
"""Effects that can be concealed in this engine."""


def on_rotorpy(spec: CaseSpec) -> CaseSpec | None:
    """The case as RotorPy can fly it, at most four of its flights; None if it lacks an effect.

    The airframe loses the drag of its body and gets that of its rotors, which the simulator knows, with the implied
    damping. It has one time constant up and down. Parameters of effects are drawn again for it.
    """
    several = (*spec.concealed, *spec.known)
    if any(hidden.effect not in EFFECTS_HERE for hidden in several):
        return None
    rng = np.random.default_rng([spec.seed, 103, spec.index])
    airframe = replace(spec.airframe, drag_N_s_m=(0.0, 0.0, 0.0), tau_down_s=spec.airframe.tau_up_s)

    def anew(hidden: Hidden) -> Hidden:
        p = dict(EFFECTS[hidden.effect].draw(hidden.size, rng, airframe))
        if hidden.effect == "motor_lag":
            p["tau_up_s"] = p["tau_down_s"]
        if hidden.effect == "drag_rotor":
            p["d"][1] = p["d"][0]  # RotorPy's is the same to all sides
        return replace(hidden, parameters=p)

    concealed, known = tuple(map(anew, spec.concealed)), tuple(map(anew, spec.known))
    drag = next((h for h in (*concealed, *known) if h.effect == "drag_rotor"), None)
    if drag is None:
        drag = anew(Hidden("drag_rotor", "medium", {}))
        known = (*known, drag)
    known = (*known, Hidden("angular_damping", "small", {"d_r": implied_damping(airframe, drag.parameters["d"])}))
    few = min(len(spec.flights), MOST_FLIGHTS)
    for hidden in concealed:
        if hidden.flights is not None and min(hidden.flights) >= few:
            few = len(spec.flights)  # a change late in the day is not cut off
    concealed = tuple(h if h.flights is None else replace(h, flights=tuple(j for j in h.flights if j < few))
                      for h in concealed)
    faults = tuple(replace(f, flights=tuple(sorted({min(j, few - 1) for j in f.flights}))) for f in spec.faults)
    return replace(spec, airframe=airframe, flights=spec.flights[:few], concealed=concealed, known=known, faults=faults)


def import_multirotor() -> Any:
    """RotorPy's Multirotor; raises MissingExtraError when the extra is not installed."""
    try:
        from rotorpy.vehicles.multirotor import Multirotor
    except ImportError:
        raise MissingExtraError("rotorpy", "rotorpy") from None
    return Multirotor


def hover_rad_s(airframe: Airframe) -> float:
    """Sum of the four rotor speeds in hover."""
    return 4.0 * float(np.sqrt(airframe.mass_kg * 9.81 / 4.0 / airframe.k_f_N_s2))


def implied_damping(airframe: Airframe, rotor_drag: Sequence[float]) -> list[float]:
    """angular_damping d_r [N m s] of rotor drag (k_d, k_d, k_z) that acts at the rotors, at hover speed."""
    k_d, _, k_z = rotor_drag
    arm = hover_rad_s(airframe) * ARM_M**2
    return [float(f"{arm * k:.5g}") for k in (k_z, k_z, 2.0 * k_d)]


def quad_params(true: Airframe, believed: Airframe, rotor_drag: Sequence[float], com_m: Sequence[float],
                ) -> dict[str, Any]:
    """RotorPy's dictionary of a vehicle; ``believed`` says at which hover speed the flapping is meant."""
    jx, jy, jz = true.inertia_kg_m2
    rotors = {f"r{i + 1}": np.array([x - com_m[0], y - com_m[1], 0.0]) for i, (x, y) in enumerate(POSITIONS_M)}
    return {"mass": true.mass_kg, "Ixx": jx, "Iyy": jy, "Izz": jz, "Ixy": 0.0, "Ixz": 0.0, "Iyz": 0.0,
            "c_Dx": 0.0, "c_Dy": 0.0, "c_Dz": 0.0, "num_rotors": 4, "rotor_pos": rotors,
            "rotor_directions": np.array(SPIN), "rotor_speed_min": 0.0, "rotor_speed_max": SPEED_MAX_RAD_S,
            "k_eta": true.k_f_N_s2, "k_m": true.yaw_arm_m * true.k_f_N_s2, "k_d": rotor_drag[0], "k_z": rotor_drag[2],
            "k_h": 0.0, "k_flap": true.drag_torque_N_s / hover_rad_s(believed), "tau_m": true.tau_up_s,
            "motor_noise_std": 0.0}


@dataclass
class _Place:
    """What a force of the world may depend on."""

    position: np.ndarray
    velocity: np.ndarray


class RotorPyEngine(Engine):
    """n of RotorPy's multirotors. The last four states are rotor speeds rad/s in place of thrusts."""

    def __init__(self, vehicles: Vehicles, position_m: np.ndarray, yaw_rad: np.ndarray, airframes: Sequence[Airframe],
                 effects: Sequence[Acting], believed: Sequence[Airframe]) -> None:
        multirotor = import_multirotor()
        own = {effect.name: (rows, effect) for rows, effect in effects if effect.name in OWN}
        kept = [(rows, effect) for rows, effect in effects if effect.name not in OWN or effect.name == "wind"]
        super().__init__(vehicles, position_m, yaw_rad, airframes, kept)
        n = len(vehicles)
        drag, offset = np.zeros((3, n)), np.zeros((3, n))
        for name, parameter, into in (("drag_rotor", "d", drag), ("com_offset", "r", offset)):
            if name in own:
                rows, effect = own[name]
                into[:, rows] = effect.a[parameter]
        self._bodies = [multirotor(quad_params(airframes[i], believed[i], drag[:, i].tolist(), offset[:, i].tolist()))
                        for i in range(n)]
        self._tau_s = np.array([a.tau_up_s for a in airframes])
        self._packed = np.zeros((n, 20))
        self._packed[:, 13:16] = self._wind.T
        self._known: tuple[np.ndarray, np.ndarray] | None = None
        self._before: np.ndarray | None = None

    def derivative(self, s: np.ndarray) -> np.ndarray:
        """Time derivative of the state (17, n): RotorPy's, and what acts from outside."""
        speeds = np.sqrt(np.maximum(self.command_N, 0.0) / self._k_f)
        out = np.empty_like(s)
        self._packed[:, :13], self._packed[:, 16:] = s[:13].T, s[THRUST].T
        for i, body in enumerate(self._bodies):
            found = body._s_dot_fn(0.0, self._packed[i], speeds[:, i])
            out[:13, i], out[13:, i] = found[:13], found[16:]
        push = self.disturbance_m_s2.copy()
        air = _Place(s[POSITION], s[VELOCITY])
        for rows, effect in self._with["push"]:
            push[:, rows] += effect.push(_at(air, rows)) / self.vehicles.mass_kg[rows]
        moment = np.zeros_like(push)
        if (s[2] < self.ground_z).any():
            x, y, _ = rotation_columns(s[QUATERNION])
            self._add_contact(s, (x[2], y[2]), push, moment)
        out[VELOCITY] += push
        out[RATE] += moment / self._inertia
        return out

    def forces(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Specific force in the world (3, n) m/s^2, moment (not used by any sensor, zero), columns of R."""
        force = self._first(s)[VELOCITY].copy()
        force[2] += self.gravity
        return force, np.zeros_like(force), np.array(rotation_columns(s[QUATERNION]))

    def _first(self, s: np.ndarray) -> np.ndarray:
        """The derivative at the present state; velocity and rate do not depend on the command, which may change."""
        if self._known is None or self._known[0] is not s:
            self._known = s, self.derivative(s)
        return self._known[1]

    def step(self, dt_s: float) -> None:
        """One step with the held command: rotor speeds exactly, the body by Adams and Bashforth's rule of second
        order. That evaluates RotorPy once a step (two thirds of all time goes there)."""
        s = self.state
        slope = self._first(s)
        before = slope if self._before is None else self._before
        self._before = slope
        speeds = np.sqrt(np.maximum(self.command_N, 0.0) / self._k_f)
        rotors = speeds + (s[THRUST] - speeds) * np.exp(-dt_s / self._tau_s)
        s = s + dt_s * (1.5 * slope - 0.5 * before)
        s[THRUST] = rotors
        q = s[QUATERNION]
        q /= np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
        self.state = s
        current = self.vehicles.motor_conductance_A_V * self.battery_V * self._load
        self.charge = self.charge - dt_s * current / self.vehicles.capacity_A_s
        for rows, effect in self._with["advance"]:
            effect.advance(dt_s, self.motor[:, rows])


def _at(air: _Place, rows: np.ndarray | slice) -> Any:
    """The vehicles ``rows``; no push asks for more than a place and a velocity."""
    return air if isinstance(rows, slice) else _Place(air.position[:, rows], air.velocity[:, rows])
