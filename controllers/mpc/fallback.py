"""What flies when a plan cannot be made: the last plan, then the geometric controller, then a landing.

Per vehicle; every step that is not flown on a fresh plan is counted by what replaced it.
"""

import numpy as np

from nanobench_tools.firmware.motor_output import MotorOutput
from nanobench_tools.methods import Reference, VehicleState
from nanobench_tools.physics.vehicle import Vehicle
from nanobench_tools.settings import number

from ..geometric import LAG_S, Geometric

PLAN_S = 0.2
"""The last plan is flown for so long, or to its end if that comes first."""
GEOMETRIC_S = 2.0
"""Then the geometric controller for so long, then the vehicle lands."""
SINK_M_S, LANDED_M = 0.4, 0.05
LEAST_V = number("control.fallback.least_v")
EMPTY_S = number("control.fallback.empty_s")
"""A battery below this voltage for so long, under the load of the motors, is a reason to land. Hover takes 2.84 to
2.90 V at the motors of the recorded vehicle."""


class Fallback:
    """Of n vehicles. ``counts``: vehicle-steps flown by each stage, and those in which the battery was too low."""

    def __init__(self, n: int, period_s: float, vehicle: Vehicle, lag_s: float = LAG_S) -> None:
        self.period_s = period_s
        self.counts = {"plan": 0, "geometric": 0, "land": 0, "empty": 0}
        self.missing_s, self._empty_s = np.zeros((2, n))
        self.landing = np.zeros(n, bool)
        self._whole = False  # whether every vehicle has a fresh plan
        self._calm = True  # whether none is without a plan, on an empty battery or landing
        self._place, self._yaw = np.zeros((n, 3)), np.zeros(n)
        self._geometric = Geometric(vehicle, lag_s=lag_s)
        self._geometric.reset(n)
        self._motors = MotorOutput(n, period_s)
        self._geometric.drive_with(self._motors)

    def commanded(self, state: VehicleState, reference: Reference) -> tuple[Reference, np.ndarray]:
        """The reference, replaced for vehicles that land by one that comes down where landing began, and which do."""
        if self._calm and state.battery_V.min() >= LEAST_V:
            return reference, self.landing
        self._calm = False
        low = state.battery_V < LEAST_V
        self._empty_s = np.where(low, self._empty_s + self.period_s, 0.0)
        empty = self._empty_s > EMPTY_S
        self.counts["empty"] += int(np.count_nonzero(empty))
        begins = (empty | (self.missing_s > PLAN_S + GEOMETRIC_S)) & ~self.landing
        self._place[begins], self._yaw[begins] = state.position_m[begins], reference.yaw_rad[begins]
        self.landing |= begins
        if not self.landing.any():
            return reference, self.landing
        self._place[self.landing, 2] = np.maximum(self._place[self.landing, 2] - self.period_s * SINK_M_S, LANDED_M)
        col = self.landing[:, None]
        down = np.array([0.0, 0.0, -SINK_M_S]) * (self._place[:, 2:] > LANDED_M)
        still = np.zeros_like(self._place)
        jerk = still if reference.jerk_m_s3 is None else reference.jerk_m_s3
        turn = np.zeros(len(col)) if reference.yaw_rate_rad_s is None else reference.yaw_rate_rad_s
        return Reference(np.where(col, self._place, reference.position_m),
                         np.where(self.landing, self._yaw, reference.yaw_rad),
                         np.where(col, down, reference.velocity_m_s), np.where(col, still, reference.acceleration_m_s2),
                         np.where(col, still, jerk), np.where(self.landing, 0.0, turn)), self.landing

    def note(self, planned: np.ndarray) -> None:
        """planned (n,) bool: vehicles for which a plan was found in this period."""
        self._whole = bool(planned.all())
        if not (self._whole and self._calm):
            self.missing_s = np.where(planned, 0.0, self.missing_s + self.period_s)
            self._calm = not (self.missing_s.any() or self._empty_s.any() or self.landing.any())

    def from_plan(self) -> np.ndarray:
        """Vehicles (n,) that fly an old plan now."""
        return (self.missing_s > 0.0) & (self.missing_s <= PLAN_S + 1e-9)

    def replaced(self, time_s: float, state: VehicleState, reference: Reference, command: np.ndarray) -> np.ndarray:
        """PWM (n, 4) with those of vehicles that have been without a plan for longer replaced."""
        if self._whole and not self.landing.any():
            self._motors.filtered_V[:] = state.battery_V
            return command
        old = self.from_plan()
        without = (self.missing_s > 0.0) & ~old
        self.counts["plan"] += int(np.count_nonzero(old))
        self.counts["geometric"] += int(np.count_nonzero(without & ~self.landing))
        self.counts["land"] += int(np.count_nonzero(self.landing))
        if not without.any():
            self._motors.filtered_V[:] = state.battery_V  # nothing filters it while it waits
            return command
        return np.where(without[:, None], self._geometric.command(time_s, state, reference), command)
