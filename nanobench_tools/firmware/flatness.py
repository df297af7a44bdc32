"""Body rates that a path asks for (pptraj.c, piecewise polynomial evaluation): the thrust has to turn with the jerk."""

import numba as nb
import numpy as np

from ..units import GRAVITY_M_S2


@nb.njit(cache=True)
def body_rates(acceleration_m_s2: np.ndarray, jerk_m_s3: np.ndarray, yaw_rad: np.ndarray,
               yaw_rate_rad_s: np.ndarray) -> np.ndarray:
    """Acceleration, jerk (n, 3) world, yaw [rad] and its rate (n,) -> rates (n, 3) rad/s of the body that flies it.

    The thrust over mass is t = a + g e3. The axes of the body are z = t/|t|, y = z x (cos yaw, sin yaw, 0) normalised,
    and x = y x z. With h = (j - (j.z) z)/|t| the rates are (-h.y, h.x, z_z yaw_rate). They are zero
    where the path requires free fall or thrust along the heading.
    """
    out = np.zeros((len(yaw_rad), 3))
    for i in range(len(yaw_rad)):
        tx, ty, tz = acceleration_m_s2[i, 0], acceleration_m_s2[i, 1], acceleration_m_s2[i, 2] + GRAVITY_M_S2
        length = np.sqrt(tx * tx + ty * ty + tz * tz)
        if length == 0.0:
            continue
        zx, zy, zz = tx / length, ty / length, tz / length
        c, s = np.cos(yaw_rad[i]), np.sin(yaw_rad[i])
        yx, yy, yz = -zz * s, zz * c, zx * s - zy * c
        side = np.sqrt(yx * yx + yy * yy + yz * yz)
        if side > 0.0:
            yx, yy, yz = yx / side, yy / side, yz / side
        jx, jy, jz = jerk_m_s3[i, 0], jerk_m_s3[i, 1], jerk_m_s3[i, 2]
        along = jx * zx + jy * zy + jz * zz
        hx, hy, hz = (jx - along * zx) / length, (jy - along * zy) / length, (jz - along * zz) / length
        out[i, 0] = -(hx * yx + hy * yy + hz * yz)
        out[i, 1] = hx * (yy * zz - yz * zy) + hy * (yz * zx - yx * zz) + hz * (yx * zy - yy * zx)
        out[i, 2] = zz * yaw_rate_rad_s[i]
    return out
