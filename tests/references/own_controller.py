"""A controller of one's own: tilt towards where the position is wanted, turn the body there, hold the yaw.

    nanobench simulate --controller own_controller:TiltAndTurn --out flown
"""

import numpy as np

from nanobench_tools import so3
from nanobench_tools.frames import MOTOR_SIGNS, gravity_up


class TiltAndTurn:
    name = "tilt_and_turn"
    information = "as flown"  # position and yaw only; "preview" would also get velocity and acceleration
    period_s = 0.002
    hover_V = 2.75  # mean motor voltage that carries the vehicle

    def reset(self, n):
        self.pull, self.rate = np.zeros((n, 3)), np.zeros((n, 3))

    def command(self, time_s, state, reference):
        error = np.clip(reference.position_m - state.position_m, -0.5, 0.5)
        self.pull = np.clip(self.pull + 2.0 * error * self.period_s, -2.0, 2.0)
        wanted = gravity_up() + 7.0 * error - 4.5 * state.velocity_m_s + self.pull  # specific force, m/s^2
        lift = np.linalg.norm(wanted, axis=1, keepdims=True)
        up = so3.rotate_inverse(state.quaternion, wanted / lift)  # where "up" has to go, seen from the body
        yaw = np.remainder(reference.yaw_rad - so3.euler_zyx(state.quaternion)[:, 2] + np.pi, 2 * np.pi) - np.pi
        turn = np.column_stack([-up[:, 1], up[:, 0], 0.5 * yaw])  # rotation vector, rad
        lead = 0.03 * (state.rate_rad_s - self.rate) / self.period_s  # makes up for the lag of the motors
        self.rate = state.rate_rad_s
        moment = np.array([0.05, 0.05, 0.1]) * (8.0 * turn - state.rate_rad_s - lead)
        ratio = self.hover_V * np.sqrt(lift / 9.81) / state.battery_V[:, None]
        return np.clip(ratio + moment @ MOTOR_SIGNS.T, 0.0, 1.0)
