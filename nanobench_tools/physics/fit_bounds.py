"""Bounds of a fit: those of the terms, narrowed to what a fit may find."""

import numpy as np

from .model import Model


def bounds(model: Model) -> tuple[np.ndarray, np.ndarray]:
    """(lower, upper) (P,): the terms' own bounds, narrowed to what a fit may find (``Parameter.fitted``)."""
    lower, upper = model.lower.copy(), model.upper.copy()
    for i, slot in enumerate(model.slots):
        fitted = slot.parameter.fitted
        if fitted is not None:
            low, high = fitted(model.vehicle)[slot.element] if callable(fitted) else fitted[:2]
            lower[i], upper[i] = max(lower[i], low), min(upper[i], high)
    return lower, upper
