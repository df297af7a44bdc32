"""``nb.tune_onboard``: parameters of the vehicle's own Kalman filter from recordings."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..flight import Flight
from ..steps.onboard_parameters import parameters_toml, tune_onboard_flights, tuning_sentence
from .quiet_options import given, some, speaks_python

if TYPE_CHECKING:
    import pandas as pd

    from ..protocols.onboard_tuning import OnboardTuning


@dataclass(frozen=True, repr=False)
class OnboardParameters:
    """Parameters of the vehicle's Kalman filter.

    Attributes
    ----------
    tuning : OnboardTuning
        As in tune_onboard.json.
    failed : tuple of dict
        Flights that failed: item, file and error.
    """

    tuning: OnboardTuning
    failed: tuple[dict[str, str], ...]

    @property
    def parameters(self) -> dict[str, float]:
        """Values by the firmware's names, such as ``kalman.dragB_x`` in 1/s."""
        return dict(self.tuning.parameters)

    @property
    def sentence(self) -> str:
        """The drag, and what the parameters change on held-out flights."""
        return tuning_sentence(self.tuning)

    @property
    def table(self) -> pd.DataFrame:
        """One row per filter, clock and metric.

        Columns: mean over held-out flights with its interval, n, and the ratio to the filter as flown.
        """
        import pandas as pd

        rows = []
        for row in self.tuning.rows:
            for metric, found in row.metrics.items():
                told = None if row.ratios is None else row.ratios.get(metric)
                low, high = found.ci95 or (None, None)
                less, more = (None if told is None else told.ci95) or (None, None)
                rows.append((row.what, row.clock, metric, found.mean, low, high, found.n,
                             None if told is None else told.ratio, less, more))
        return pd.DataFrame(rows, columns=["what", "clock", "metric", "mean", "ci95_low", "ci95_high", "n", "ratio",
                                           "ratio_low", "ratio_high"])

    def to_toml(self) -> str:
        """The parameters as a file, a table ``[parameters]``."""
        return parameters_toml(self.tuning)

    def __repr__(self) -> str:
        return self.sentence

    def _repr_html_(self) -> str:
        found: str = self.table.to_html(index=False)
        return found


@speaks_python
def tune_onboard(flights: Flight | Iterable[Flight], pose_delay: float | None = None,
                 seed: int = 0) -> OnboardParameters:
    """Find parameters of the vehicle's Kalman filter, and score them on held-out flights.

    The firmware's filter is run again with each set of parameters. Drag needs firmware 2026.04 or later.

    Parameters
    ----------
    flights : Flight or iterable of Flight
        With IMU and poses, as ``nb.load`` gives them.
    pose_delay : float or None
        Delay of the poses on board, s. None: that with which the filter run again is nearest to its logged estimate.
    seed : int
        Of everything random. The same seed gives the same result.

    Returns
    -------
    OnboardParameters
        Parameters by the firmware's names, and a table of errors before and after.

    Raises
    ------
    InputError
        Where no flight has an IMU and poses, or all are too slow to show drag.

    Examples
    --------
    >>> import nanobench_tools as nb
    >>> nb.tune_onboard(nb.load("flights")).parameters  # doctest: +SKIP
    """
    read = some(flights)
    options = given(read, seed=seed)
    found = tune_onboard_flights(options, read, pose_delay)
    return OnboardParameters(found, tuple(options.failed))
