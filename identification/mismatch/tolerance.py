"""Noise floor: effects below these sizes can come from the logging alone and are not identified, however significant.

Rows come every 10 ms and packets are lost, while the vehicle commands its motors every 1 to 2 ms from a noisy gyro. A
row's command is one of five to ten that acted. Gains from command to torque are therefore known to a fifth, times to
half a row or more.
"""

from __future__ import annotations

import numpy as np

from nanobench_tools.physics import Model
from nanobench_tools.physics.model import Slot
from nanobench_tools.physics.systematic import UNDECLARED
from nanobench_tools.physics.vocabulary import terms_that
from nanobench_tools.settings import number

from .fitting import Fit
from .moments import Moments
from .size import growth, usual

MOST_GAIN = number("mismatch.tolerance.most_gain")
MOST_DAMPING_1_S = number("mismatch.tolerance.most_damping_1_s")
ASKED = number("mismatch.tolerance.asked")
ASKED_DAMPING = number("mismatch.tolerance.asked_damping")
ANSWERED = terms_that(lambda term: term.answered)
ANSWER = number("mismatch.tolerance.answer")
LEAST_FORCE_M_S2 = number("mismatch.tolerance.least_force_m_s2")
LEAST_TURNING_SHARE = number("mismatch.tolerance.least_turning_share")
APART_SD = number("mismatch.tolerance.apart_sd")
APART_FEW_SD = number("mismatch.tolerance.apart_few_sd")
LEAST_SHAKING = number("mismatch.tolerance.least_shaking")


def impossible(term: str, fit: Fit, before: Model) -> str:
    """Why a fitted term is not physically plausible: a sentence, empty if it is."""
    old, new = before.parameters, fit.model.parameters
    for name in fit.on_bound:
        if name.startswith(f"{term}.") and new[name] != _neutral(fit.model, name):
            return f"{term} ends on the bound of {name}, which is no result"
    for name in (fit.model.names[i] for i in fit.free if fit.model.names[i].startswith(f"{term}.")):
        factor, times = slot_of(fit.model, name).parameter.implausible, new[name] / old[name] if old.get(name) else 1.0
        if factor and not 1.0 / factor < times < factor:
            return f"{term} would be {times:.2g} times what is believed: no vehicle"
    return ""


def feigned(term: str, fit: Fit, before: Model, moments: Moments) -> str:
    """Why a fitted term is no finding: a sentence, empty if it is one."""
    old = before.parameters
    changed = False
    for place, i in enumerate(fit.free):
        name = fit.model.names[i]
        if not name.startswith(f"{term}."):
            continue
        change = abs(fit.model.values[i] - old.get(name, 0.0))
        sd = float(np.sqrt(fit.covariance[place, place]))
        if name in fit.own:  # the mean of flights that differ is not informative, their spread is
            slot = slot_of(fit.model, name)
            if slot.parameter.differs is None:
                least = smallest(name, before, moments, fit.model)
            else:
                share = slot.parameter.systematic is not None and slot.parameter.systematic.of == "value"
                least = slot.parameter.differs * (abs(old[name]) if share else growth(before, slot.parameter))
            changed = changed or (float(np.ptp(fit.own[name])) > least and two_groups(fit.own[name]))
        else:  # coefficients of a curve are only known jointly: without a noise floor the gain alone decides
            limit = smallest(name, before, moments, fit.model)
            changed = changed or limit == 0.0 or change - 2.0 * sd > limit
    if not changed:
        return f"{term} changes less than errors of logging could"
    if any(name.startswith(f"{term}.") for name in fit.own):
        return ""
    force, torque = effect(fit, before, moments)
    if term in ANSWERED:
        moves = float(moments.wrench.model(fit.model)[0][:, 2].std())
        if force < ANSWER * moves:
            return (f"{term} changes the force by {force:.3f} m/s^2 RMS, and the controller's answers to the air look "
                    f"like up to {ANSWER * moves:.3f}")
    if force < LEAST_FORCE_M_S2 and torque < LEAST_TURNING_SHARE:
        return (f"{term} changes the force by {force:.3f} m/s^2 RMS and torque by {torque:.0%} of what is left: "
                "too little")
    return ""


def two_groups(values: np.ndarray) -> bool:
    """Whether values (flights,) form two groups, as after a change. The best two means are further apart, in standard
    deviations within the groups, than in 90 to 97 % of normal samples. Fewer than four flights cannot scatter."""
    ordered = np.sort(values)
    many = len(ordered)
    if many < 4:
        return True
    parts = [(ordered[:k], ordered[k:]) for k in range(1, many)]
    apart = max((high.mean() - low.mean()) ** 2 / max((np.sum((low - low.mean()) ** 2) +
                                                       np.sum((high - high.mean()) ** 2)) / (many - 2), 1e-30)
                for low, high in parts)
    return bool(apart > (APART_SD + APART_FEW_SD / (many - 2)) ** 2)


def _neutral(model: Model, name: str) -> float | str | None:
    return slot_of(model, name).parameter.neutral


def slot_of(model: Model, name: str) -> Slot:
    """Of a flat name; raises KeyError."""
    return model.slots[model.index(name)]


def smallest(name: str, before: Model, moments: Moments, best: Model | None = None) -> float:
    """Noise floor of a parameter, in its unit; 0 without one, a fraction of the usual size where its term gives no
    floor. ``best``: the model whose residual shows how much of the rotation the commands leave unexplained."""
    slot = slot_of(best or before, name)
    feigns = slot.parameter.systematic
    if feigns is None:
        return UNDECLARED * usual(best or before, slot)
    if feigns.of == "unit":
        return feigns.size
    if feigns.of == "value":
        return feigns.size * abs(before.parameters[name])
    share = _shake(best or before, moments, name)
    told = _told(moments, share, name)
    if feigns.of == "gain":
        value = abs(before.parameters[name])
        return (ASKED if told else 1.0) * min(feigns.size * max(share, LEAST_SHAKING), MOST_GAIN) * value
    inertia = before.values_of("inertia").get("inertia_kg_m2", before.vehicle.inertia_kg_m2)
    found: float = ((ASKED_DAMPING if told else 1.0) * min(feigns.size * max(share, LEAST_SHAKING), MOST_DAMPING_1_S)
                    * inertia[_axis(name)])
    return found


def _told(moments: Moments, share: float, name: str) -> bool:
    """Whether set-points are logged, which gyro noise does not reach."""
    return bool(moments.wrench.of("asked_rad_s2", moments.wrench.torque_at).any() and share < 1.0 and _axis(name) < 2)


def _shake(model: Model, moments: Moments, name: str) -> float:
    """Unexplained share of the turning about a parameter's axis. Yaw is commanded by all four motors, which shake with
    every axis."""
    share, axis = unexplained_share(model, moments), _axis(name)
    return float(share.max() if axis == 2 else share[axis])


def _axis(name: str) -> int:
    return int(name[-2]) if name.endswith("]") else 2


def unexplained_share(model: Model, moments: Moments) -> np.ndarray:
    """(3,) RMS of the rotation that a model does not explain, over the RMS of the rotation."""
    wrench = moments.wrench
    left = wrench.residual(model)[1]
    return np.asarray(np.sqrt(left.var(axis=0) / np.maximum(wrench.measured[1].var(axis=0), 1e-12)))


def effect(fit: Fit, before: Model, moments: Moments) -> tuple[float, float]:
    """RMS change by a fit: of force m/s^2, of torque as a share of the residual's RMS."""
    wrench = moments.wrench
    new, old = wrench.model(fit.model), wrench.model(before)
    left = wrench.measured[1] - new[1]
    force = float(np.sqrt(np.mean(np.sum((new[0] - old[0]) ** 2, axis=1))))
    if not len(left):
        return force, 0.0
    shares = np.sqrt(np.mean((new[1] - old[1]) ** 2, axis=0) / np.maximum(np.mean(left**2, axis=0), 1e-12))
    return force, float(shares.max())
