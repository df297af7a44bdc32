"""The choice among candidate maps, by files of the training set that were held out in turn."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from nanobench_tools.settings import number

from .maps import Map

NO_WORSE = number("thrust.choose.no_worse")

NO_WORSE_ONE_FILE = number("thrust.choose.no_worse_one_file")


@dataclass(frozen=True)
class HeldOut:
    """Errors [N] of a candidate on held-out rows: one array per fold, prediction minus measurement. Also the root of
    the mean over folds of their mean squares.

    trouble: the message of the first fold whose fit failed."""

    errors: tuple[np.ndarray, ...]
    rms: float
    trouble: str = ""


def choose(fits: Mapping[str, Any], scores: Mapping[str, HeldOut], no_worse: float = NO_WORSE,
           spread: float = np.inf) -> str | None:
    """Name of the map with the smallest held-out error, or of lower rank and no worse; None if none is a result.

    Three kinds of maps are never chosen: maps with trouble in the fit, the firmware's own, and maps no better than a
    constant. The last kind is judged on held-out rows (``spread``: the SD of the predicted values).
    """
    able = [n for n, fit in fits.items() if not fit.trouble and map_of(fit).fixed is None
            and not scores[n].trouble.startswith("not ") and scores[n].rms < spread]
    if not able:
        return None
    limit = no_worse * min(scores[n].rms for n in able)
    return min((n for n in able if scores[n].rms <= limit),
               key=lambda n: (map_of(fits[n]).rank, map_of(fits[n]).size, scores[n].rms))


def map_of(fit: Any) -> Map:
    """The map of a fit to thrust-stand series or to flights."""
    found: Map = fit.map if hasattr(fit, "map") else fit.model.map
    return found
