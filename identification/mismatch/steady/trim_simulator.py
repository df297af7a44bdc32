"""A simulator of the normal vehicle from its trim, and the same with the identified cause, as far as hover shows it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from identification.thrust.firmware import PLUS
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.settings import number
from nanobench_tools.units import GRAVITY_M_S2

from .causes import Body
from .causes.other_vehicle import GAINS
from .weigh import PRIOR, Normal

K_M_M = number("mismatch.trim_simulator.k_m_m")


def simulator_of(normal: Normal, body: Body) -> Model | None:
    """The firmware's thrust curve, scaled so that the trim carries the weight, with a gain per motor; the rest is of
    the type. None where the battery was not measured. Unequal gains also represent a centre of mass off the middle: the
    two are indistinguishable in hover."""
    if not normal.known_lift:
        return None
    tilt = {} if np.isnan(normal.mean["level"]).any() else {"frame_tilt": {
        "roll_rad": float(-normal.mean["level"][1] / GRAVITY_M_S2),
        "pitch_rad": float(normal.mean["level"][0] / GRAVITY_M_S2)}}
    each = body.mass_kg * GRAVITY_M_S2 / 4.0 / np.exp(normal.mean["gains"])
    vehicle = Vehicle(mass_kg=body.mass_kg, motor_positions_m=tuple((float(x), float(y)) for x, y in body.motors))
    return _with_gains(Model(vehicle, {"thrust_voltage": {"c": PLUS.c}, "yaw_torque": {"k_m": K_M_M}, **tilt}), each)


def believed_by(simulator: Model) -> Normal | None:
    """The trim a simulator would hover with; None without a thrust map of the motor voltage. Its spread is that of
    flights of one vehicle. The spread between vehicles is added if the simulator treats all motors as equal."""
    terms = simulator.as_dict()
    if "thrust_voltage" not in terms:
        return None
    vehicle = simulator.vehicle
    x, y = (np.array(vehicle.motor_positions_m, float) - np.array(
        terms.get("com_offset", {}).get("r_m", (0.0, 0.0, 0.0))[:2])).T
    balance = np.stack([np.ones(4), x, y, np.array(vehicle.spin, float)])
    try:
        asked = np.linalg.solve(balance, [vehicle.mass_kg * vehicle.gravity_m_s2, 0.0, 0.0, 0.0])
    except np.linalg.LinAlgError:
        return None
    each = np.array(terms.get("motor_imbalance", {}).get("g", np.ones(4)))
    gains = terms.get("thrust_scale", {}).get("s", 1.0) * each
    volts = np.linspace(1.2, 4.4, 1601)
    thrust = np.polynomial.polynomial.polyval(volts, np.array(terms["thrust_voltage"]["c"]))
    if (np.diff(thrust) <= 0.0).any() or (asked / gains <= thrust[0]).any() or (asked / gains >= thrust[-1]).any():
        return None
    curve = np.polynomial.polynomial.polyval(np.interp(asked / gains, thrust, volts), PLUS.c)
    tilt = terms.get("frame_tilt")
    level = np.full(2, np.nan) if tilt is None else vehicle.gravity_m_s2 * np.array(
        [tilt["pitch_rad"], -tilt["roll_rad"]])
    sd = {name: usual for name, (usual, _) in PRIOR.items()}
    if "motor_imbalance" not in terms:
        sd["gains"] = float(np.hypot(sd["gains"], GAINS))
    return Normal({"gains": np.log(curve), "level": level, "push": np.zeros(2)}, sd,
                  {name: freedom for name, (_, freedom) in PRIOR.items()}, 0, (), True)


def _with_gains(model: Model, gains: np.ndarray) -> Model:
    """Gains of the motors, their mean taken into the thrust curve."""
    terms = model.as_dict()
    mean = float(gains.mean())
    c = tuple(float(mean * x) for x in terms["thrust_voltage"]["c"])
    return Model(model.vehicle, {**terms, "thrust_voltage": {**terms["thrust_voltage"], "c": c},
                                 "motor_imbalance": {"g": tuple(float(g) for g in gains / mean)}})


def corrected(model: Model, finding: Mapping[str, Any]) -> Model | None:
    """``model`` with a finding of ``steady.compare``; None for causes that are no parameter of a simulator."""
    sizes = {name: p["value"] for name, p in finding["parameters"].items()}
    vehicle = model.vehicle
    if finding["causes"][0] in ("propeller", "tape"):
        loss = np.array([sizes.get(f"loss_m{m}", 0.0) / 100.0 for m in (1, 2, 3, 4)])
        gains = np.array(model.as_dict().get("motor_imbalance", {}).get("g", np.ones(4)))
        return _with_gains(model, gains * (1.0 - loss))
    if finding["causes"][0] in ("weight", "slung"):
        added = sizes["mass"] / 1e3
        whole = vehicle.mass_kg + added
        offset = (*(float(added / whole * sizes[k] / 1e3) for k in ("x", "y")), 0.0)
        before = model.as_dict().get("com_offset", {}).get("r_m", (0.0, 0.0, 0.0))
        moved = tuple(vehicle.mass_kg / whole * b + o for b, o in zip(before, offset, strict=True))
        return Model(replace(vehicle, mass_kg=whole), {**model.as_dict(), "com_offset": {"r_m": moved}})
    if finding["causes"][0] == "mass":
        return Model(replace(vehicle, mass_kg=vehicle.mass_kg * (1.0 + sizes["change"] / 100.0)), model.as_dict())
    return None
