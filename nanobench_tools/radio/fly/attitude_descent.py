"""Down without a position: attitude and thrust alone, where poses are gone and the vehicle's estimate is not trusted.

The vehicle brakes the last known speed by tilting against it, then stays level. Thrust keeps a slow descent by the
accelerometer. Without fresh logs it stays level, with a thrust a little below hover. The motors stop where the ground
should be, or after a limit.
"""

from collections.abc import Callable

import numpy as np

from ... import so3
from ...units import GRAVITY_M_S2
from ..host_clock import Clock
from ..vehicle_link import Link
from . import setpoint_packets
from .dead_reckoning import FRESH_S, DeadReckoning
from .pose_tracker import Believed
from .safety_handover import EVERY_S, _try

SINK_M_S = 0.4
BRAKE_S, BRAKE_1_S = 1.5, 2.5
"""Time after which the attitude is level, as the speed is no longer known well; and deceleration per speed."""
TILT_DEG = 20.0
LIFT_1_S = 2.0
"""Vertical acceleration per error of the sink rate."""
LEAST_SHARE, MOST_SHARE, LOW_SHARE, BLIND_SHARE = 0.85, 1.1, 0.9, 0.97
"""Thrust in units of hover: bounds, most near the ground, and without logs."""
AFTER_S = 1.0
"""Time beyond the planned descent: on the ground the thrust below hover does no harm, a fall does."""
SETTLES_S = 2.5
"""Time in which a vehicle that rises with 0.5 m/s comes down by a metre, with the least thrust below."""
LOW_M = 0.05
"""Height over the ground below which the thrust stays below hover, and a vehicle that is seen is stopped."""
OFF_TIMES = 25


def descend(link: Link, clock: Clock, state: DeadReckoning, ground_m: float, seen: Callable[[], Believed | None],
            tick: Callable[[], None], brakes: bool = True) -> None:
    """Descend by attitude and thrust and stop the motors. ``state``: kept up to date by ``tick``; ``seen()``: the
    vehicle as believed poses show it, None without. ``brakes``: the last speed is known."""
    begun, height_m = clock.now(), max(float(state.position_m[2]) - ground_m, 0.0)
    most_s = height_m / SINK_M_S + AFTER_S
    while (since := clock.now() - begun) < most_s:
        now = seen()
        if now is not None and now.position_m[2] < ground_m + LOW_M:
            break
        _try(link.send_setpoint, command(state, since, ground_m, brakes))
        tick()
        clock.sleep_until(clock.now() + EVERY_S)
    stop_motors(link, clock, tick)


def settle(link: Link, clock: Clock, state: DeadReckoning, tick: Callable[[], None]) -> None:
    """End a landing without poses: level, with thrust below hover, since the vehicle may be higher than it seems."""
    begun = clock.now()
    while clock.now() - begun < SETTLES_S:
        _try(link.send_setpoint, command(state, BRAKE_S, np.inf))
        tick()
        clock.sleep_until(clock.now() + EVERY_S)
    stop_motors(link, clock, tick)


def stop_motors(link: Link, clock: Clock, tick: Callable[[], None]) -> None:
    for _ in range(OFF_TIMES):
        _try(link.send_setpoint, setpoint_packets.stop())
        tick()
        clock.sleep_until(clock.now() + EVERY_S)


def command(state: DeadReckoning, since_s: float, ground_m: float = -np.inf, brakes: bool = True) -> bytes:
    """The set-point ``since_s`` after the beginning of the descent."""
    yaw = float(so3.euler_zyx(state.quaternion)[2])
    if state.imu_s > FRESH_S:
        return setpoint_packets.attitude(BLIND_SHARE * state.hover_counts, 0.0, 0.0)
    brake = -BRAKE_1_S * state.velocity_m_s[:2] if brakes and since_s < BRAKE_S else np.zeros(2)
    most = GRAVITY_M_S2 * np.tan(np.radians(TILT_DEG))
    brake *= min(1.0, most / max(float(np.linalg.norm(brake)), 1e-9))
    wanted = setpoint_packets.attitude_of(np.array([*brake, 0.0]), yaw)
    roll, pitch, _ = so3.euler_zyx(so3.multiply(so3.conjugate(state.turn), wanted))
    lift = 1.0 + LIFT_1_S * (-SINK_M_S - float(state.velocity_m_s[2])) / GRAVITY_M_S2
    most_share = MOST_SHARE if state.position_m[2] > ground_m + LOW_M else LOW_SHARE
    share = float(np.clip(lift, LEAST_SHARE, most_share))
    return setpoint_packets.attitude(share * state.hover_counts, float(roll), float(pitch))
