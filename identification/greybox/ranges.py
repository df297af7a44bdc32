"""Physical signs and ranges of fitted parameters, where they are narrower than the terms' own, and soft priors.

A fit with free sign and lag learns the inverted flight controller. The reason: the logged PWM of the next half second
was computed from the gyro of that half second. Such a fit scores best and is no vehicle. Hence motors never run ahead
of their command, thrust rises with voltage, lateral air tips the nose up, and rotation decays. Turning inertia is that
of a vehicle of this mass and size.
"""

import numpy as np

from nanobench_tools.physics import Model
from nanobench_tools.settings import number

from .solve import Prior

MEAN_SD = number("greybox.ranges.mean_sd")


def priors(model: Model) -> tuple[Prior, ...]:
    """Soft terms of a fit of ``model``: means that are given by definition, then what its terms believe, from the
    motors inwards."""
    found = []
    for term in sorted(model.terms, key=lambda term: -term.stage):
        for parameter in term.parameters:
            names = tuple(s.name for s in model.slots if s.term is term and s.parameter is parameter)
            if parameter.fixed_mean is not None and names:
                found.append(Prior(names, parameter.fixed_mean * len(names), MEAN_SD,
                                   f"gains have mean {parameter.fixed_mean:g}", (1.0,) * len(names)))
    for slot in sorted(model.slots, key=lambda slot: -slot.term.stage):
        belief = slot.parameter.believed
        if callable(belief):
            belief = belief(model.vehicle)[slot.element]
        if belief is not None:
            found.append(Prior((slot.name,), belief.mean, belief.sd, belief.source))
    return tuple(found)


def held(model: Model) -> tuple[str, ...]:
    """Names that no flight identifies: yaw shows only k_m / J_z, and translation only thrust over mass."""
    return tuple(slot.name for slot in model.slots if slot.element in slot.parameter.unidentifiable)


def falling_thrust(model: Model, low_V: float, high_V: float) -> str:
    """Fault of the thrust map over the motor voltages (or ratios) that were flown, or an empty string."""
    for term in ("thrust_voltage", "thrust_pwm"):
        if term in model:
            c = np.asarray(model.values_of(term)["c"])
            at = np.linspace(low_V, high_V, 21)
            if np.any(np.polyval((c[1:] * np.arange(1, len(c)))[::-1], at) <= 0.0):
                return f"{term} falls with the command between {low_V:.3g} and {high_V:.3g}"
    return ""
