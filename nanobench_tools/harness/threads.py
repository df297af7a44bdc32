"""One numerical thread per item: sums then have one order, so that a result does not depend on the cores there are."""

import scipy.linalg  # noqa: F401  (its own BLAS has to be loaded before it can be limited)
from threadpoolctl import threadpool_limits


def one_thread() -> threadpool_limits:
    """Context in which the linear algebra of NumPy and SciPy uses one thread; as it was before, afterwards.

    Called without ``with`` it holds for the rest of the process.
    """
    return threadpool_limits(1)
