"""``nb.sample``: the three SYNTHETIC flights that come with the package."""

from .loading import Flights
from .quiet_options import speaks_python


@speaks_python
def sample() -> Flights:
    """Return the three sample flights (SYNTHETIC) that are installed with the package.

    One simulated vehicle flies a circle, a trefoil and a multisine, 18 s each. The circle is clean. The radio log of
    the trefoil stops in the air. The vehicle's timestamps of the multisine wander by about 20 ms. ``nanobench sample``
    writes the same files into a folder.

    Returns
    -------
    Flights
        ``sample_circle``, ``sample_multisine_sysid`` and ``sample_trefoil``.

    Examples
    --------
    >>> import nanobench_tools as nb
    >>> nb.sample().names
    ['sample_circle', 'sample_multisine_sysid', 'sample_trefoil']
    """
    from ..practice.sample_files import SAMPLE
    from .loading import load

    return load(SAMPLE)
