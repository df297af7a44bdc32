"""``nb.simulate``: practice flights, SYNTHETIC, through the whole logging chain."""

from ..methods import Controller
from .loading import Flights
from .quiet_options import speaks_python


@speaks_python
def simulate(n: int = 1, seed: int = 0, family: str | None = None, seconds: float | None = None,
             controller: Controller | None = None) -> Flights:
    """Make flights (SYNTHETIC), each of a different vehicle, flown on a path and logged as the recordings are.

    Parameters
    ----------
    n : int
        How many.
    seed : int
        The same arguments give the same flights.
    family : str, optional
        Of the path (``circle``, ``figure_eight`` ...); None: all in turn.
    seconds : float, optional
        Length of the path, s.
    controller : Controller, optional
        Your own, which flies all of them; None: the onboard PID and Mellinger.

    Returns
    -------
    Flights
        Without a controller of yours they are kept in the cache: half a minute the first time.

    Raises
    ------
    UsageError
        For an unknown family.

    Examples
    --------
    >>> import nanobench_tools as nb
    >>> nb.simulate(2, seed=1, seconds=12.0)[0].provenance.synthetic
    True
    """
    from ..errors import UsageError
    from ..harness.identity import item_key
    from ..practice.flights import practice_flights
    from ..practice.references import path_spec
    from ..sources import cache

    if n < 1:
        raise UsageError(f"n is {n}; simulate at least one flight")
    if family is not None:
        path_spec(family)  # says which there are
    families = None if family is None else (family,)
    if controller is not None:
        return Flights(practice_flights(n, seed, families=families, duration_s=seconds, controller=controller))
    key = item_key(practice_flights, {"n": n, "seed": seed, "families": families, "duration_s": seconds})
    entries = [cache.entry_path(f"{key}{i:06d}", "practice", 1) for i in range(n)]
    kept = [cache.fetch(entry, entry.name, "") for entry in entries]
    found = [flight for flight in kept if flight is not None]
    if len(found) < n:
        found = practice_flights(n, seed, families=families, duration_s=seconds)
        for entry, flight in zip(entries, found, strict=True):
            cache.store(entry, flight)
    return Flights(found)
