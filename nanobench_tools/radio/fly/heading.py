"""The heading of a vehicle that is sent rates: its own loop holds an angle, which is led to where it should be.

The firmware adds up the yaw rate it is sent and holds the angle that comes of it (controller_pid.c), about 0.2 s late.
A controller's moment about z, made for motors at hand, would have to pass through that loop; it is not used.
"""

from ... import so3
from ...methods import Reference, VehicleState

YAW_1_S = 1.5
"""Speed at which a heading that is off is led back: well below the 5 rad/s of the vehicle's loop."""
MOST_RAD_S = 4.0


def yaw_rate(state: VehicleState, reference: Reference) -> float:
    """Of the set-point [rad/s], one vehicle."""
    off = float(so3.wrap_angle(float(reference.yaw_rad[0]) - float(so3.euler_zyx(state.quaternion[0])[2])))
    turning = 0.0 if reference.yaw_rate_rad_s is None else float(reference.yaw_rate_rad_s[0])
    return min(max(turning + YAW_1_S * off, -MOST_RAD_S), MOST_RAD_S)
