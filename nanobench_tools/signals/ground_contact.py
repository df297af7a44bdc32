"""Where shocks are to be expected: near the ground, once the vehicle has taken off."""

import numpy as np

from ..settings import count, number
from .airborne import airborne_spans, height_of, resting_height_m
from .context import Context
from .dropouts import alive_until
from .mocap_derivatives import widened
from .usable_rows import usable_streams

NEAR_M = number("audit.ground_contact.near_m")
BEFORE_S = number("audit.ground_contact.before_s")
AROUND_ROWS = count("audit.ground_contact.around_rows")


def contact_likely(context: Context, at_s: np.ndarray) -> np.ndarray:
    """(n,) bool for times ``at_s``: low (or within half a second of it) from just before take-off to the end.

    There a true shock of the airframe cannot be distinguished from a wrong sample, the less as packets are lost in a
    landing. All True if heights are unknown; before take-off, or in a recording without flight, all False.
    """
    air = context.once(airborne_spans)
    heights = [h for h in (context.once(height_of), _estimated(context)) if h is not None and len(h[0]) > 10]
    if not heights:
        return np.ones(len(at_s), dtype=bool)
    risky = np.zeros(len(at_s), dtype=bool)
    for time_s, z in heights if air else []:
        low = (z < resting_height_m(z) + NEAR_M) & (time_s > air[0].start_s - BEFORE_S)
        risky |= widened(low, AROUND_ROWS)[np.clip(np.searchsorted(time_s, at_s), 0, len(time_s) - 1)]
    return risky


def _estimated(context: Context) -> tuple[np.ndarray, np.ndarray] | None:
    """The estimator's height: the tracker may jump, the vehicle lands all the same."""
    stream = context.once(usable_streams).get("estimator")
    if stream is None or "z" not in stream.quantities:
        return None
    good = np.isfinite(stream["z"]) & (stream.time_s <= context.once(alive_until)["estimator"])
    return stream.time_s[good], stream["z"][good]
