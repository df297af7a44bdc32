"""How much the thrust of a vehicle differs from one session to the next at the same command."""

from __future__ import annotations

from nanobench_tools.physics import Vehicle
from nanobench_tools.settings import setting

SHARES: dict[str, float] = setting("posterior.thrust_spread.shares")
"""Standard deviation by the simulator's input, as a share of thrust."""


def thrust_spread(vehicle: Vehicle) -> float:
    """m/s^2. Batteries, motors and propellers of the day; a simulator that knows rotor speeds is free of the first two.

    >>> thrust_spread(Vehicle(input="pwm")) > 10.0 * thrust_spread(Vehicle(input="rpm"))
    True
    """
    return SHARES[vehicle.input] * vehicle.gravity_m_s2
