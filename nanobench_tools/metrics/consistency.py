"""Does the covariance of an estimator agree with its error? NEES and NIS with chi-square bands.

References
----------
Bar-Shalom, Li, Kirubarajan 2001, "Estimation with Applications to Tracking and Navigation", section 5.4.
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2


@dataclass(frozen=True)
class Consistency:
    """Mean normalised squared error and its band.

    The mean is in the band with ``probability`` if the filter is consistent and the n errors are independent.

    Attributes
    ----------
    mean : float
        Expected to be ``dimension``.
    dimension : int
        Of the error.
    n : int
        Number of errors.
    band : tuple of float
        Low and high end.
    probability : float
        Of the band.
    """

    mean: float
    dimension: int
    n: int
    band: tuple[float, float]
    probability: float

    @property
    def verdict(self) -> str:
        """``consistent``, ``overconfident`` (error larger than stated) or ``underconfident``."""
        if self.mean > self.band[1]:
            return "overconfident"
        return "underconfident" if self.mean < self.band[0] else "consistent"


def normalised_squared(error: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Compute e^T P^-1 e: NEES of a state error and its covariance, NIS of an innovation and its covariance S.

    Parameters
    ----------
    error : ndarray
        (n, k) in any units. Attitude errors are rotation vectors, the logarithm of R^T R_est.
    covariance : ndarray
        (n, k, k) or (k, k) in their squares.

    Returns
    -------
    ndarray
        (n,).

    Raises
    ------
    ValueError
        For shapes that do not fit, or a covariance that is not positive definite.
    """
    e, p = np.asarray(error, float), np.asarray(covariance, float)
    if e.ndim != 2 or p.shape[-2:] != (e.shape[1], e.shape[1]) or (p.ndim == 3 and len(p) != len(e)):
        raise ValueError(f"errors {e.shape} and covariances {p.shape} do not fit")
    try:
        factor = np.linalg.cholesky(p)
    except np.linalg.LinAlgError:
        raise ValueError("a covariance is not positive definite") from None
    white = np.linalg.solve(np.broadcast_to(factor, (len(e), *factor.shape[-2:])), e[..., None])[..., 0]
    return np.asarray(np.sum(white * white, axis=1))


def consistency(error: np.ndarray, covariance: np.ndarray, probability: float = 0.95) -> Consistency:
    """Compute the average NEES (or NIS) with its chi-square band: n mean ~ chi2(n k).

    Errors of one filter run are correlated in time, so the band is too narrow for them. Give the means over flights, or
    thinned rows.

    Parameters
    ----------
    error : ndarray
        (n, k) in any units. Attitude errors are rotation vectors, the logarithm of R^T R_est.
    covariance : ndarray
        (n, k, k) or (k, k) in their squares.
    probability : float
        Of the band.

    Returns
    -------
    Consistency
        Mean, band, and a verdict.

    Raises
    ------
    ValueError
        Without errors, and as of ``normalised_squared``.
    """
    values = normalised_squared(error, covariance)
    n, k = np.asarray(error).shape
    if n == 0:
        raise ValueError("no errors given")
    tails = np.array([0.5 * (1.0 - probability), 0.5 * (1.0 + probability)])
    low, high = chi2.ppf(tails, n * k) / n
    return Consistency(float(values.mean()), k, n, (float(low), float(high)), probability)


def independent_samples(white: np.ndarray) -> float:
    """Return the number of independent rows to which correlated rows are equivalent where their squares are averaged.

    It is n / (1 + 2 sum r_j^2), at least 1. Here r is the autocorrelation of a column about zero, up to where the mean
    over columns first falls below 0.05. Squares of Gaussian numbers with correlation r have correlation r^2.

    Parameters
    ----------
    white : ndarray
        (n, k).

    Returns
    -------
    float
        1 to n.

    References
    ----------
    Bayley, Hammersley 1946, "The 'effective' number of independent observations in an autocorrelated time series".
    """
    x = np.asarray(white, float)
    n = len(x)
    if n < 4 or not np.any(x):
        return float(n)
    size = 1 << (2 * n - 1).bit_length()
    power = np.fft.irfft(np.abs(np.fft.rfft(x, size, axis=0)) ** 2, size, axis=0)[: n // 2]
    small = np.flatnonzero(power.sum(axis=1) < 0.05 * power[0].sum())
    until = int(small[0]) if len(small) else len(power)
    square = np.sum(power**2, axis=1)
    return float(max(n / (1.0 + 2.0 * square[1:until].sum() / square[0]), 1.0))
