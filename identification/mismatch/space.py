"""The space of hypotheses around a simulator: its model with every other effect of the vocabulary added at the value
where it does nothing, so that a hypothesis is a few free parameters of one model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from nanobench_tools import registry
from nanobench_tools.physics import Model
from nanobench_tools.physics.model import find_term, neutral
from nanobench_tools.settings import number

from .size import K_F, growth

MAPS = ("thrust_pwm", "thrust_voltage", "thrust_rpm")
LEVEL = ("mass", "thrust_scale")
"""What a thrust curve contains. Only their ratio pushes; both at once are a gain from command to torque, which has
other names."""
LEAST_SAG_V = number("mismatch.space.least_sag_v")
"""A voltage that changes by less tells nothing about its influence."""
HELD = ("ground_effect.rho", "thrust_rpm.k_f")
"""Parameters that are not asked for: they are only seen in products, rho R^2 and d / sqrt(k_f)."""
AT_REST = {"saturation": {"u_max": 1.0, "T_max_N": 50.0}}
SCALE_SHARE = number("mismatch.space.scale_share")
"""Scale of a parameter that rests at 0 and says none: this share of its range."""


@dataclass(frozen=True)
class Space:
    """``model``: the simulator's terms and all others at rest; ``believed``: the terms of the simulator; unasked: terms
    that the recordings cannot tell anything about."""

    model: Model
    believed: tuple[str, ...]
    unasked: tuple[str, ...] = ()

    def free(self, term: str) -> np.ndarray:
        """Indices of the parameters a hypothesis about ``term`` may change."""
        return np.array([i for i, slot in enumerate(self.model.slots)
                         if slot.term.name == term and slot.name not in HELD], int)

    @property
    def terms(self) -> tuple[str, ...]:
        """Terms with something to change."""
        return tuple(t.name for t in self.model.terms if t.name not in self.unasked and len(self.free(t.name)))


def scales(model: Model) -> np.ndarray:
    """(P,) usual size of each parameter, on a vehicle of this size."""
    found = []
    for slot, value in zip(model.slots, model.values, strict=True):
        typical = slot.parameter.typical
        size = abs(typical[min(slot.element, len(typical) - 1)] if isinstance(typical, tuple) else typical)
        size = size or min(1.0, SCALE_SHARE * (slot.parameter.upper - slot.parameter.lower)) * (value == 0.0)
        found.append(max(abs(value), size * growth(model, slot.name.partition("[")[0])))
    return np.array(found)


def space_around(simulator: Model, unasked: tuple[str, ...] = ()) -> Space:
    """Every registered effect that has a value without effect, beside those of ``simulator``."""
    terms: dict[str, Mapping[str, Any]] = dict(simulator.as_dict())
    believed = tuple(terms)
    if "thrust_rpm" not in terms:
        terms["thrust_rpm"] = {"k_f": K_F}
    for name in sorted(registry.names("terms")):
        if name in terms or name in MAPS:
            continue
        rest = AT_REST.get(name) or neutral(find_term(name), simulator.vehicle)
        if rest is not None and not (simulator.vehicle.input != "pwm" and name == "saturation"):
            terms[name] = rest
    return Space(Model(simulator.vehicle, terms), believed, unasked)


def with_other_map(simulator: Model, battery_V: float) -> Model | None:
    """The simulator with thrust from the motors' voltage where it had PWM, or the reverse, equal at ``battery_V``."""
    for here, there, power in (("thrust_pwm", "thrust_voltage", -1.0), ("thrust_voltage", "thrust_pwm", 1.0)):
        if here in simulator and simulator.vehicle.input == "pwm":
            terms = simulator.as_dict()
            c = np.array(terms[here]["c"]) * battery_V ** (power * np.arange(len(terms[here]["c"])))
            return Model(simulator.vehicle, {there if n == here else n: {"c": tuple(c)} if n == here else v
                                             for n, v in terms.items()})
    return None


def space_of_other_map(simulator: Model, battery_V: np.ndarray, unasked: tuple[str, ...] = ()) -> Space | None:
    """The space around the simulator with the other thrust map, where the battery (n,) V in the air changed enough to
    tell the two."""
    other = with_other_map(simulator, float(np.median(battery_V))) if np.ptp(battery_V) > LEAST_SAG_V else None
    return None if other is None else space_around(other, unasked)


def reduced(model: Model, believed: tuple[str, ...], named: tuple[str, ...]) -> Model:
    """The model without the terms at rest that nobody named."""
    keep = {*believed, *named}
    gains = [i for i, name in enumerate(model.names) if name.startswith("motor_imbalance.g")]
    if gains:  # a fit that touched a bound may have left the mean
        values = model.values.copy()
        values[gains] /= values[gains].mean()
        model = model.with_values(values)
    if {"drag_rotor", "rotor_gyro"} & keep:
        keep.add("thrust_rpm")
    return model.without(*(t.name for t in model.terms if t.name not in keep))
