"""From PWM to rotor speed for parameters of others that begin at the rotor speed, and their rotors in our order."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..model import Model
from ..vehicle import Vehicle

CURVE = Model(Vehicle(), {"thrust_voltage": {"c": (-0.0248, 0.0652, -0.0268, 0.00678)}})
"""Thrust of a Crazyflie's motor over PWM times battery voltage: where the diagnosis' own search begins too."""


def stated(what: str, mass_kg: float) -> tuple[str, ...]:
    """Message when ``CURVE`` was used instead."""
    c = ", ".join(f"{x:g}" for x in CURVE.values)
    return (f"{what} ({1e3 * mass_kg:.1f} g) takes rotor speeds; PWM and battery voltage were turned into thrust by "
            f"thrust_voltage c = [{c}], which is then part of what is judged",)


def in_our_order(quad_params: Mapping[str, Any]) -> dict[str, Any]:
    """RotorPy's parameters with rotors in the order of the motors here (front right, back right, back left, front left)
    by their places."""
    places = np.array([np.asarray(p, float) for p in quad_params["rotor_pos"].values()])
    ours = np.array([(1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)])
    order = [int(np.argmax(places[:, :2] @ quadrant)) for quadrant in ours]
    return {**quad_params, "rotor_pos": {f"r{i + 1}": places[k].tolist() for i, k in enumerate(order)},
            "rotor_directions": [float(quad_params["rotor_directions"][k]) for k in order]}
