"""Copy values in compiled code. Numba takes seconds to compile ``out[a:b] = values``, for the text of its errors."""

import numba as nb
import numpy as np


@nb.njit(cache=True)
def put(out: np.ndarray, values: np.ndarray) -> None:
    """out[:n] = values for values (n,)."""
    for k in range(len(values)):
        out[k] = values[k]


@nb.njit(cache=True)
def put_matrix(out: np.ndarray, values: np.ndarray) -> None:
    """out[:n, :m] = values for values (n, m)."""
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            out[i, j] = values[i, j]
