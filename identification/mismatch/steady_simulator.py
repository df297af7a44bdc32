"""A simulator of the normal vehicle from its trim, and the same with what was named: only what hover tells."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from identification.thrust.firmware import PLUS
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.units import GRAVITY_M_S2

from .causes import Body
from .weigh import Normal


def simulator_of(normal: Normal, body: Body) -> Model | None:
    """The firmware's thrust curve, scaled so that the trim carries the weight, with a gain per motor; the rest is of
    the type. None where the battery was not measured. Unequal gains stand for a centre of mass off the middle too:
    hover shows both alike."""
    if not normal.known_lift:
        return None
    each = body.mass_kg * GRAVITY_M_S2 / 4.0 / np.exp(normal.mean["gains"])
    vehicle = Vehicle(mass_kg=body.mass_kg, motor_positions_m=tuple((float(x), float(y)) for x, y in body.motors))
    return _with_gains(Model(vehicle, {"thrust_voltage": {"c": PLUS.c}, "yaw_torque": {"k_m": 0.006}}), each)


def _with_gains(model: Model, gains: np.ndarray) -> Model:
    """Gains of the motors, their mean taken into the thrust curve."""
    terms = model.as_dict()
    mean = float(gains.mean())
    c = tuple(float(mean * x) for x in terms["thrust_voltage"]["c"])
    return Model(model.vehicle, {**terms, "thrust_voltage": {**terms["thrust_voltage"], "c": c},
                                 "motor_imbalance": {"g": tuple(float(g) for g in gains / mean)}})


def corrected(model: Model, finding: Mapping[str, Any]) -> Model | None:
    """``model`` with a finding of ``steady.compare``; None for causes that are no number of a simulator."""
    sizes = {name: p["value"] for name, p in finding["parameters"].items()}
    vehicle = model.vehicle
    if finding["causes"][0] in ("propeller", "tape"):
        loss = np.array([sizes.get(f"loss_m{m}", 0.0) / 100.0 for m in (1, 2, 3, 4)])
        return _with_gains(model, np.array(model.as_dict()["motor_imbalance"]["g"]) * (1.0 - loss))
    if finding["causes"][0] in ("weight", "slung"):
        added = sizes["mass"] / 1e3
        whole = vehicle.mass_kg + added
        offset = (*(float(added / whole * sizes[k] / 1e3) for k in ("x", "y")), 0.0)
        return Model(replace(vehicle, mass_kg=whole), {**model.as_dict(), "com_offset": {"r_m": offset}})
    if finding["causes"][0] == "mass":
        return Model(replace(vehicle, mass_kg=vehicle.mass_kg * (1.0 + sizes["change"] / 100.0)), model.as_dict())
    return None
