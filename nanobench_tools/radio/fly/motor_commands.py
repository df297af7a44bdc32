"""Any controller that commands motors, flown over a radio: its motor commands as collective thrust and body rates.

The thrust comes from the firmware's curve of the four commands at the battery's voltage; the firmware turns it back
into the same mean command. The controller's moment M becomes the body rate that it would have led to after LEAD_S. It
is w_s = w + LEAD_S J^-1 M, with w the rate at the time it acts. LEAD_S is about the delay from here to a turning
vehicle (link, rate loop, motors): shorter, and the vehicle hardly turns; longer, and it swings. The vehicle's loop
controls the heading (``heading``).

The state is predicted to the time at which the set-point acts, at constant body rate and at the acceleration of the
thrust under way. Gains made for direct motor commands are high for this delay. Controllers that make set-points
(``setpoint``, see ``pilot``) or predict their states (``predictive``) fly better.
"""

import numpy as np

from ... import so3
from ...firmware.thrust_curve import THRUST_MAX_N, thrust_of_voltage
from ...methods import Controller, Reference, VehicleState
from ...physics.vehicle import Vehicle
from ...settings import number
from ...units import GRAVITY_M_S2
from . import setpoint_packets
from .heading import yaw_rate
from .pilot import PERIOD_S, PID

LEAD_S = number("flying.motor_commands.lead_s")
MOST_RATE_RAD_S = 8.0
THRUST_SCALE = number("flying.motor_commands.thrust_scale")


class MotorPilot:
    """Flies ``controller`` with thrust and rates. ``vehicle``: what its motor commands are thought to move."""

    kind, onboard, hosted = "thrust-rates", PID, True

    def __init__(self, controller: Controller, vehicle: Vehicle | None = None) -> None:
        self.controller, self.name = controller, controller.name
        vehicle = vehicle or Vehicle()
        arms = np.array(vehicle.motor_positions_m)
        self._moment = np.stack([arms[:, 1], -arms[:, 0]]) / np.array(vehicle.inertia_kg_m2)[:2, None]
        self._mass = vehicle.mass_kg
        self._every = max(round(PERIOD_S / controller.period_s), 1)
        self._delay_s = 0.0

    def link_delay(self, seconds: float) -> None:
        self._delay_s = max(seconds, 0.0)

    def reset(self) -> None:
        self.controller.reset(1)
        self._lift = GRAVITY_M_S2

    def packet(self, time_s: float, state: VehicleState, reference: Reference) -> bytes:
        then = self._ahead(state)
        for step in range(self._every):
            command = np.asarray(self.controller.command(time_s + step * self.controller.period_s, then, reference))
        if command.shape != (1, 4) or not np.isfinite(command).all():
            raise ValueError(f"commanded {command.tolist()}, not four finite PWM ratios")
        thrust = thrust_of_voltage(command[0] * state.battery_V[0])
        self._lift = THRUST_SCALE * float(thrust.sum()) / self._mass
        wanted = then.rate_rad_s[0, :2] + LEAD_S * (self._moment @ (THRUST_SCALE * thrust))
        wanted = np.clip(wanted, -MOST_RATE_RAD_S, MOST_RATE_RAD_S)
        counts = float(thrust.mean()) / THRUST_MAX_N * setpoint_packets.MOST_COUNTS
        return setpoint_packets.rates(counts, np.array([*wanted, yaw_rate(then, reference)]))

    def _ahead(self, state: VehicleState) -> VehicleState:
        """The state when a set-point of now acts."""
        d = self._delay_s
        turned = so3.multiply(state.quaternion, so3.exp(0.5 * d * state.rate_rad_s))
        pull = so3.rotate(turned, np.array([0.0, 0.0, self._lift])) - np.array([0.0, 0.0, GRAVITY_M_S2])
        return VehicleState(state.position_m + d * state.velocity_m_s + 0.5 * d * d * pull,
                            state.velocity_m_s + d * pull,
                            so3.multiply(state.quaternion, so3.exp(d * state.rate_rad_s)), state.rate_rad_s,
                            state.battery_V)
