"""Overlapping Allan deviation.

W. J. Riley, "Handbook of Frequency Stability Analysis", NIST SP 1065 (2008), eq. 11, for rates (frequency data).
"""

import numpy as np


def overlapping_allan(values: np.ndarray, m: int) -> tuple[np.ndarray, int]:
    """(variance (d,), terms): Allan variance of the columns of ``values`` (n, d) averaged over m samples, overlapping.

    ``terms`` is how many differences it rests on (about terms / m of them independent); nan and 0 where n < 2 m.
    """
    values = np.asarray(values, float)
    terms = len(values) - 2 * m + 1
    if terms < 1 or m < 1:
        return np.full(values.shape[1], np.nan), 0
    total = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
    second = total[2 * m :] - 2.0 * total[m:-m] + total[: -2 * m]
    return np.sum(second**2, axis=0) / (2.0 * m * m * terms), terms
