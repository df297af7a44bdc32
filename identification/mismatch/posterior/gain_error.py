"""How far a gain from logged commands may be too small, measured on the same flights.

Logged commands are noisy, so a regression shrinks every gain from them. The most is the share of the command's motion
that the measured motion does not follow, 1 - r^2. Source: errors in variables, Fuller 1987, Measurement Error Models,
ch. 1.
Where in that range the gain lies is unknown.
"""

from __future__ import annotations

import numpy as np

UNIFORM = 3.0**-0.5
"""Root mean square of what is uniform between 0 and 1."""


def gain_error(made: np.ndarray, measured: np.ndarray, flight: np.ndarray) -> float:
    """Standard deviation of a gain of 1 between a command's effect and the motion that follows.

    ``made``, ``measured``: effect and motion (n,). ``flight`` (n,): the mean of each flight is subtracted.

    >>> gain_error(np.arange(4.0), np.arange(4.0), np.zeros(4))
    0.0
    """
    means = [np.zeros(len(made)), np.zeros(len(made))]
    for one in np.unique(flight):
        mine = flight == one
        for mean, values in zip(means, (made, measured), strict=True):
            mean[mine] = values[mine].mean()
    a, b = made - means[0], measured - means[1]
    return float(UNIFORM * (1.0 - (a @ b) ** 2 / max(float(a @ a) * float(b @ b), 1e-12)))
