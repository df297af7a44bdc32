"""Air that simulated vehicles share: the jet below one pushes down another one that flies in it.

The jet is steady, straight down, and carries the momentum of the hover thrust. So the vehicle is assumed to hover, and
no other wind blows. The profile is the Gaussian of a round turbulent jet, whose width grows in proportion to the
distance (Pope, Turbulent Flows, 2000, section 5.1). The lower vehicle is a flat plate as large as its rotor discs (drag
coefficient 1.18). The model omits moments, the thrust that the lower rotors lose, and the time that the air takes.

On the axis, a vehicle of 34 g is pushed by 13 g at 0.2 m and 6 g at 0.5 m. Others read about 10 g and 4 g off figure 3
of Neural-Swarm (Shi et al., ICRA 2020), for such a vehicle.
"""

import math
from collections.abc import Sequence
from typing import Any

AIR_KG_M3, DRAG = 1.2, 1.18
ROTORS, ROTOR_RADIUS_M = 4, 0.0231
"""Of a Crazyflie 2."""
START_WIDTH_M = 0.06
"""Radius of the jet at the rotors (where it has 1/e of its speed): about their reach from the centre."""
SPREAD = 0.094 / math.sqrt(math.log(2.0))
"""Growth of this radius per distance, from the half-width of a round jet."""
TURNS = 0.05
"""PWM ratio from which rotors make a jet."""


def downwash_m_s(thrust_N: float, below_m: float, aside_m: float) -> float:
    """Speed of the air below a vehicle, ``aside_m`` from its axis; 0 above it."""
    if below_m <= 0.0:
        return 0.0
    width = START_WIDTH_M + SPREAD * below_m
    axis = math.sqrt(2.0 * thrust_N / (AIR_KG_M3 * math.pi)) / width  # the momentum of the jet is the thrust
    return axis * math.exp(-(aside_m / width) ** 2)


def downwash_N(speed_m_s: float) -> float:
    """Downward force on a vehicle in this air."""
    area_m2 = ROTORS * math.pi * ROTOR_RADIUS_M**2
    return 0.5 * AIR_KG_M3 * DRAG * area_m2 * speed_m_s**2


class SharedAir:
    """Served vehicles that fly in one room; each one asks for the force on it."""

    def __init__(self, vehicles: Sequence[Any]) -> None:
        self._vehicles = tuple(vehicles)
        for vehicle in self._vehicles:
            vehicle.air = self

    def force_N(self, own: Any) -> tuple[float, float, float]:
        """On a vehicle (world): speeds of all jets that reach it add up."""
        x, y, z = own.place_m
        speed = sum(downwash_m_s(other.hover_N, above[2] - z, math.hypot(above[0] - x, above[1] - y))
                    for other in self._vehicles if other is not own and other.rotors_turn
                    for above in (other.place_m,))
        return 0.0, 0.0, -downwash_N(speed)
