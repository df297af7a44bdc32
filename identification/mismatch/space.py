"""The space of hypotheses around a simulator: its model, with every other effect of the vocabulary added without
effect.

A hypothesis is a few free parameters of this one model.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from nanobench_tools.physics import Model
from nanobench_tools.physics.model import neutral
from nanobench_tools.physics.vocabulary import terms_that, vocabulary
from nanobench_tools.settings import number

from .size import K_F, growth, range_share, typical

MAPS = terms_that(lambda term: term.is_map)
PWM_MAPS = terms_that(lambda term: term.is_map and term.input == "pwm")
IN_PRODUCTS = terms_that(lambda term: term.in_products)
LEVEL = terms_that(lambda term: term.level)
"""Terms that a thrust curve contains. Only their ratio acts as a force. Both at once are a gain from command to torque,
which other terms model."""
LEAST_SAG_V = number("mismatch.space.least_sag_v")


@dataclass(frozen=True)
class Space:
    """``model``: the simulator's terms and all others at rest; ``believed``: the terms of the simulator; unasked: terms
    that the recordings cannot show."""

    model: Model
    believed: tuple[str, ...]
    unasked: tuple[str, ...] = ()

    def free(self, term: str) -> np.ndarray:
        """Indices of the parameters a hypothesis about ``term`` may change."""
        return np.array([i for i, slot in enumerate(self.model.slots)
                         if slot.term.name == term and not slot.parameter.in_product], int)

    @property
    def terms(self) -> tuple[str, ...]:
        """Terms with something to change."""
        return tuple(t.name for t in self.model.terms
                     if not t.not_asked and t.name not in self.unasked and len(self.free(t.name)))


def scales(model: Model) -> np.ndarray:
    """(P,) usual size of each parameter, on a vehicle of this size."""
    found = []
    for slot, value in zip(model.slots, model.values, strict=True):
        size = typical(slot.parameter, slot.element) or range_share(slot.parameter) * (value == 0.0)
        found.append(max(abs(value), size * growth(model, slot.parameter)))
    return np.array(found)


def space_around(simulator: Model, unasked: tuple[str, ...] = ()) -> Space:
    """The terms of ``simulator`` and every other registered term that has a value without effect."""
    terms: dict[str, Mapping[str, Any]] = dict(simulator.as_dict())
    believed = tuple(terms)
    if "thrust_rpm" not in terms:
        terms["thrust_rpm"] = {"k_f": K_F}
    for name, term in vocabulary().items():
        if name in terms or term.is_map or term.not_asked:
            continue
        rest = neutral(term, simulator.vehicle)
        if rest is not None and all(p.only_input in ("", simulator.vehicle.input) for p in term.parameters):
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
    """The space around the simulator with the other thrust map. None if the battery (n,) V in the air changed too
    little to distinguish the maps."""
    other = with_other_map(simulator, float(np.median(battery_V))) if np.ptp(battery_V) > LEAST_SAG_V else None
    return None if other is None else space_around(other, unasked)


def reduced(model: Model, believed: tuple[str, ...], named: tuple[str, ...]) -> Model:
    """The model without the terms at rest that were not identified."""
    keep = {*believed, *named}
    lists = fixed_mean(model)
    for base in dict.fromkeys(base for base in lists if base):  # a fit that touched a bound may have left the mean
        gains = [i for i, own in enumerate(lists) if own == base]
        values = model.values.copy()
        values[gains] /= values[gains].mean() / _mean_of(model, gains[0])
        model = model.with_values(values)
    for term in [t for t in model.terms if t.name in keep and t.needs and not keep & set(t.needs)]:
        keep.add(next(name for name in term.needs if name in model))
    return model.without(*(t.name for t in model.terms if t.name not in keep))


def fixed_mean(model: Model) -> list[str]:
    """(P) flat name, without the element, of a list whose mean is given by definition; empty of all others."""
    return [slot.name.partition("[")[0] if slot.parameter.fixed_mean is not None else "" for slot in model.slots]


def _mean_of(model: Model, which: int) -> float:
    mean = model.slots[which].parameter.fixed_mean
    assert mean is not None  # asked of lists with a fixed mean only
    return mean
