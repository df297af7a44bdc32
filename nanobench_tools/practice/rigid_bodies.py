"""The practice vehicle in the air and on the ground: n rigid bodies at once, RK4.

States are kept component first, (17, n), so that every operation runs over the vehicles. The parts that are evaluated
four times a step are compiled. ``Plant`` shows states with the vehicle first. Nothing sums over vehicles, so a vehicle
flies the same
alone as in a crowd.
Equations: m dv/dt = sum T_i R e3 - drag - m g e3 + contact, J dw/dt = tau - w x J w. Motors: tau dT_i/dt = T_cmd_i -
T_i, T_cmd_i = scale gain_i cubic(u_i V). Signs of the moments: ``frames.MOTOR_SIGNS``.
"""

import numba as nb
import numpy as np

from ..firmware.thrust_curve import thrust_of_voltage
from ..units import GRAVITY_M_S2
from .vehicle_parameters import OPEN_CIRCUIT, Vehicles

POSITION, VELOCITY, QUATERNION, RATE, THRUST = slice(0, 3), slice(3, 6), slice(6, 10), slice(10, 13), slice(13, 17)
STATES = 17

CONTACT_RAD_S = 200.0
"""Eigenfrequency of the legs on the ground; sinks 0.25 mm under the weight, a bounce lasts 16 ms."""
CONTACT_DAMPING = 0.35
"""Share of critical damping; rebounds by about a third of the speed."""
FRICTION = 0.6
"""Coulomb coefficient of the legs (rubber on mat), smoothed below FRICTION_SPEED_M_S."""
FRICTION_SPEED_M_S = 0.02
LEVELLING_RAD_S = 60.0
"""Eigenfrequency with which four legs press the body level while they carry the whole weight."""


def battery_voltage(charge: np.ndarray, motor: np.ndarray, vehicles: Vehicles) -> np.ndarray:
    """Charge left (n,), PWM ratios (4, n) -> terminal voltage (n,) V.

    """
    return np.asarray(np.interp(charge, OPEN_CIRCUIT[:, 0], OPEN_CIRCUIT[:, 1]) / (1.0 + battery_load(
                   motor, vehicles.resistance_ohm, vehicles.motor_conductance_A_V)))


def battery_load(motor: np.ndarray, resistance_ohm: np.ndarray, conductance_A_V: np.ndarray) -> np.ndarray:
    """(n,): open-circuit over terminal voltage is 1 more than this, at PWM ratios (4, n).

    Each motor draws u_i (u_i V) G from the cell, so V = OCV - R G V sum u_i^2 has a closed solution.
    """
    found: np.ndarray = resistance_ohm * conductance_A_V * np.sum(motor * motor, axis=0)
    return found


@nb.njit(cache=True)
def legs(depth_m: np.ndarray, velocity_m_s: np.ndarray) -> np.ndarray:
    """Specific force (3, n) m/s^2 of legs that are pressed in by depth (n,), at velocity (3, n) world. It has spring,
    damper and friction, and is zero for a vehicle in the air."""
    out = np.zeros((3, len(depth_m)))
    for i in range(len(depth_m)):
        if depth_m[i] > 0.0:
            push = CONTACT_RAD_S**2 * depth_m[i] - 2 * CONTACT_DAMPING * CONTACT_RAD_S * velocity_m_s[2, i]
            out[2, i] = max(push, 0.0)
            for k in range(2):
                out[k, i] = -FRICTION * out[2, i] * np.tanh(velocity_m_s[k, i] / FRICTION_SPEED_M_S)
    return out


def rotation_columns(q: np.ndarray) -> tuple[tuple[np.ndarray, ...], ...]:
    """Quaternions (4, n) x, y, z, w -> the columns (body axes seen in the world) of R, each three arrays (n,)."""
    x, y, z, w = q
    x2, y2, z2 = x + x, y + y, z + z
    xx, yy, zz, xy, xz, yz, wx, wy, wz = x * x2, y * y2, z * z2, x * y2, x * z2, y * z2, w * x2, w * y2, w * z2
    return ((1.0 - (yy + zz), xy + wz, xz - wy),
            (xy - wz, 1.0 - (xx + zz), yz + wx),
            (xz + wy, yz - wx, 1.0 - (xx + yy)))


_axes = nb.njit(rotation_columns)


@nb.njit(cache=True)
def _in_the_air(s: np.ndarray, of: np.ndarray, disturbance_m_s2: np.ndarray) -> tuple[np.ndarray, np.ndarray,
                                                                                     np.ndarray]:
    """State (17, n), rows of ``Plant._of`` (6, n) -> specific force, moment (3, n), columns of R (3, 3, n)."""
    n = s.shape[1]
    force, moment, columns = np.empty((3, n)), np.empty((3, n)), np.empty((3, 3, n))
    for i in range(n):
        mass, arm, yaw_arm, lateral, difference, turning = of[0, i], of[1, i], of[2, i], of[3, i], of[4, i], of[5, i]
        axes = _axes((s[6, i], s[7, i], s[8, i], s[9, i]))
        for j in range(3):
            for k in range(3):
                columns[j, k, i] = axes[j][k]
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = axes
        vx, vy, vz, t1, t2, t3, t4 = s[3, i], s[4, i], s[5, i], s[13, i], s[14, i], s[15, i], s[16, i]
        right, left, forward, turn = t1 + t2, t3 + t4, t2 - t1, t3 - t4
        lift = (right + left) / mass + difference * (vx * cx + vy * cy + vz * cz)
        force[0, i] = disturbance_m_s2[0, i] - lateral * vx + cx * lift
        force[1, i] = disturbance_m_s2[1, i] - lateral * vy + cy * lift
        force[2, i] = disturbance_m_s2[2, i] - lateral * vz + cz * lift
        moment[0, i] = (left - right) * arm - turning * (vx * bx + vy * by + vz * bz)
        moment[1, i] = (forward + turn) * arm + turning * (vx * ax + vy * ay + vz * az)
        moment[2, i] = (forward - turn) * yaw_arm
    return force, moment, columns


@nb.njit(cache=True)
def _slope(s: np.ndarray, force: np.ndarray, moment: np.ndarray, command_N: np.ndarray, tau_s: np.ndarray,
           inertia: np.ndarray, inertia_turn: np.ndarray, gravity_m_s2: float) -> np.ndarray:
    """Time derivative of the state (17, n) under forces and moments."""
    out = np.empty_like(s)
    for i in range(s.shape[1]):
        x, y, z, w = s[6, i], s[7, i], s[8, i], s[9, i]
        wx, wy, wz = s[10, i], s[11, i], s[12, i]
        hx, hy, hz = 0.5 * wx, 0.5 * wy, 0.5 * wz
        for k in range(3):
            out[k, i], out[3 + k, i] = s[3 + k, i], force[k, i]
        out[5, i] -= gravity_m_s2
        out[6, i] = w * hx + y * hz - z * hy
        out[7, i] = w * hy + z * hx - x * hz
        out[8, i] = w * hz + x * hy - y * hx
        out[9, i] = -(x * hx + y * hy + z * hz)
        out[10, i] = (moment[0, i] - inertia_turn[0, i] * (wy * wz)) / inertia[0, i]
        out[11, i] = (moment[1, i] - inertia_turn[1, i] * (wz * wx)) / inertia[1, i]
        out[12, i] = (moment[2, i] - inertia_turn[2, i] * (wx * wy)) / inertia[2, i]
        for k in range(13, 17):
            out[k, i] = (command_N[k - 13, i] - s[k, i]) / tau_s[i]
    return out


@nb.njit(cache=True)
def _stand(s: np.ndarray, x_up: np.ndarray, y_up: np.ndarray, ground_z: np.ndarray, inertia: np.ndarray,
           force: np.ndarray, moment: np.ndarray) -> None:
    """``Plant._add_contact``; ``x_up``, ``y_up`` (n,): world height of the ends of body x and y."""
    pushed = legs(ground_z - s[2], s[3:6])
    for i in range(s.shape[1]):
        share = min(pushed[2, i] / GRAVITY_M_S2, 1.0)
        level = (-y_up[i], x_up[i], 0.0)
        for k in range(3):
            force[k, i] += pushed[k, i]
            moment[k, i] += share * inertia[k, i] * (LEVELLING_RAD_S**2 * level[k] - LEVELLING_RAD_S * s[10 + k, i])


class Plant:
    """n vehicles from rest on the ground; ``step`` advances all by one period.

    position_m (n, 3) world, yaw_rad (n,): at rest. Legs begin to touch at ``ground_z`` (n,), a quarter of a millimetre
    higher.
    """

    def __init__(self, vehicles: Vehicles, position_m: np.ndarray, yaw_rad: np.ndarray, *,
                 gravity_m_s2: float = GRAVITY_M_S2) -> None:
        n = len(vehicles)
        self.vehicles, self.gravity = vehicles, gravity_m_s2
        self.state = np.zeros((STATES, n))
        self.state[POSITION] = position_m.T
        self.state[8], self.state[9] = np.sin(yaw_rad / 2.0), np.cos(yaw_rad / 2.0)
        self.ground_z = position_m[:, 2] + gravity_m_s2 / CONTACT_RAD_S**2
        self.charge = vehicles.charge_at_start.copy()
        self.battery_V = battery_voltage(self.charge, np.zeros((4, n)), vehicles)
        self.command_N = np.zeros((4, n))
        self.motor = np.zeros((4, n))
        self._load = self.mean_ratio = np.zeros(n)
        self.disturbance_m_s2 = np.zeros((3, n))
        self.flicker = np.zeros((4, n))
        jx, jy, jz = vehicles.inertia_xx_kg_m2, vehicles.inertia_yy_kg_m2, vehicles.inertia_zz_kg_m2
        self._inertia, self._inertia_turn = np.stack([jx, jy, jz]), np.stack([jz - jy, jx - jz, jy - jx])
        self._of = np.stack([vehicles.mass_kg, vehicles.arm_m, vehicles.yaw_arm_m, vehicles.drag_lateral_1_s,
                             vehicles.drag_lateral_1_s - vehicles.drag_vertical_1_s, vehicles.drag_torque_N_s])

    def forces(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """State (17, n) -> specific force in the world (3, n) m/s^2, moment (3, n) N m body, columns of R (3, 3, n)."""
        force, moment, columns = _in_the_air(s, self._of, self.disturbance_m_s2)
        if (s[2] < self.ground_z).any():
            self._add_contact(s, (columns[0, 2], columns[1, 2]), force, moment)
        return force, moment, columns

    def _add_contact(self, s: np.ndarray, tilt: tuple[np.ndarray, np.ndarray], force: np.ndarray,
                     moment: np.ndarray) -> None:
        """Spring, damper, friction and levelling of the legs; exactly zero for a vehicle in the air.

        tilt: world height of the ends of body x and y; the moment turns them to zero.
        """
        _stand(s, tilt[0], tilt[1], self.ground_z, self._inertia, force, moment)

    def derivative(self, s: np.ndarray) -> np.ndarray:
        """Time derivative of the state (17, n)."""
        force, moment, _ = self.forces(s)
        return np.asarray(_slope(s, force, moment, self.command_N, self.vehicles.motor_tau_s, self._inertia,
                                 self._inertia_turn, self.gravity))

    def apply(self, motor: np.ndarray) -> None:
        """PWM ratios (n, 4), clipped to 0..1, held from now on; sets battery_V and the thrust they ask for."""
        u = np.clip(motor.T, 0.0, 1.0)
        p = self.vehicles
        self.battery_V = battery_voltage(self.charge, u, p)
        self.motor = u
        self._load = np.sum(u * u, axis=0)
        self.mean_ratio = 0.25 * np.sum(u, axis=0)
        self.command_N = p.thrust_scale * p.motor_gain * (1.0 + self.flicker) * thrust_of_voltage(u * self.battery_V)

    def step(self, dt_s: float) -> None:
        """One RK4 step [s] with the held command; the quaternion is normalised, the cell discharged."""
        s = self.state
        k1 = self.derivative(s)
        k2 = self.derivative(s + (0.5 * dt_s) * k1)
        k3 = self.derivative(s + (0.5 * dt_s) * k2)
        k4 = self.derivative(s + dt_s * k3)
        s = s + (dt_s / 6.0) * (k1 + 2.0 * (k2 + k3) + k4)
        q = s[QUATERNION]
        q /= np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
        self.state = s
        current = self.vehicles.motor_conductance_A_V * self.battery_V * self._load
        self.charge = self.charge - dt_s * current / self.vehicles.capacity_A_s

    def specific_force(self) -> np.ndarray:
        """What an ideal accelerometer shows, body frame (3, n) m/s^2."""
        (x, y, z), _, columns = self.forces(self.state)
        return np.stack([x * a + y * b + z * c for a, b, c in columns])
