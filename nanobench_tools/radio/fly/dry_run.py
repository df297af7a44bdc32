"""A flight without a vehicle, to show its packets. The vehicle is assumed exactly at its reference."""

import numpy as np

from ...methods import VehicleState
from . import setpoint_packets
from .flight_plan import LANDING, LANDING_S, TAKEOFF, TAKEOFF_S, Plan
from .pilot import PERIOD_S, Pilot

BATTERY_V = 3.9


def rows(plan: Plan, pilot: Pilot, every_s: float) -> list[tuple[str, float, str]]:
    """(phase, time, packet) every ``every_s``; the pilot runs every tick, as in flight."""
    pilot.link_delay(0.0)
    pilot.reset()
    ends = plan.ends
    found = [(TAKEOFF, 0.0, f"high-level take-off to {plan.height_m:.2f} m in {TAKEOFF_S:.1f} s")]
    shown = -np.inf
    for tick in range(round(ends[TAKEOFF] / PERIOD_S), round(ends["hover at end"] / PERIOD_S)):
        time_s = PERIOD_S * tick
        commanded = plan.reference(time_s)
        turn = setpoint_packets.attitude_of(commanded.acceleration_m_s2[0], float(commanded.yaw_rad[0]))
        state = VehicleState(commanded.position_m, commanded.velocity_m_s, turn[None], np.zeros((1, 3)),
                             np.array([BATTERY_V]))
        packet = pilot.packet(time_s, state, commanded)
        if time_s - shown > every_s - 1e-9:
            shown = time_s
            found.append((plan.phase(time_s + 1e-9), time_s, setpoint_packets.in_words(packet)))
    found.append((LANDING, ends["hover at end"], "set-points end; high-level landing to the ground in "
                  f"{LANDING_S:.0f} s or less"))
    return found
