"""The one convention for frames and rotations, and the conversions at its edges.

World is the frame of the motion capture, z up. Body is x forward, y left, z up (FLU), right-handed.
Quaternions are stored x, y, z, w and rotate body vectors into the world: v_world = R(q) v_body.
Euler angles are ZYX (yaw about z, then pitch about y, then roll about x). In quaternions q = q_z(yaw) q_y(pitch)
q_x(roll); a positive pitch is nose down. Motors: 1 front right, 2 back right, 3 back left, 4 front left.
"""

import numpy as np

from .units import GRAVITY_M_S2

MOTOR_SIGNS = np.array([[-1.0, -1.0, -1.0], [-1.0, 1.0, 1.0], [1.0, 1.0, -1.0], [1.0, -1.0, 1.0]])
"""Sign of the moment about body x, y, z when motor 1..4 speeds up (FLU, Crazyflie X layout).

Thrust at (x, y) gives tau_x = y T, tau_y = -x T; the yaw signs are the reaction of the rotors.
"""


def gravity_up(n: int | None = None) -> np.ndarray:
    """Specific force of a body at rest, world frame [m/s^2]: (3,) or (n, 3)."""
    up = np.array([0.0, 0.0, GRAVITY_M_S2])
    return up if n is None else np.broadcast_to(up, (n, 3))
