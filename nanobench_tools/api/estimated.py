"""``nb.estimate`` and ``nb.compare``: where was it, by an estimator, against motion capture."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import NanobenchError, UsageError
from ..flight import Flight
from ..protocols.result_rows import EstimateRow
from ..protocols.task3 import check_protocol
from ..results.dataframes import frame_of
from ..steps.estimating import SHOWN_FIRST, estimate_body, see
from ..steps.named_methods import as_methods
from ..steps.sentences import estimated
from .loading import place_of
from .quiet_options import given, some, speaks_python

if TYPE_CHECKING:
    import pandas as pd

TRAJECTORY = ("x", "y", "z", "qx", "qy", "qz", "qw")
UNITS = ("m", "m", "m", "1", "1", "1", "1")


@dataclass(frozen=True, repr=False)
class Estimates:
    """Scores of estimators.

    ``estimates["flight"]`` is {method: DataFrame} of one flight, with the motion capture under ``truth``.

    Attributes
    ----------
    rows : tuple of EstimateRow
        As in estimate.json.
    trajectories : mapping
        {method: {flight: DataFrame}}, with the motion capture under ``truth``. Index: s from the first row. Columns:
        position in m, world, and quaternion x, y, z, w, body to world.
    failed : tuple of dict
        Flights that failed: item, file and error.
    """

    rows: tuple[EstimateRow, ...]
    trajectories: Mapping[str, Mapping[str, pd.DataFrame]]
    failed: tuple[dict[str, str], ...]

    @property
    def metrics(self) -> pd.DataFrame:
        """One row per method, over all flights; a column per metric, its mean over flights, SI units as in the name."""
        import pandas as pd

        rows = [row for row in self.rows if row.group == "all"] or list(self.rows)
        return pd.DataFrame([{"n": row.n, **{m: s.mean for m, s in row.metrics.items()}} for row in rows],
                            index=pd.Index([row.method for row in rows], name="method"))

    @property
    def table(self) -> pd.DataFrame:
        """One row per method, group of flights and metric: mean over flights with its interval, median, p90, n, and
        the ratio to another method."""
        return table_of(self.rows)

    @property
    def sentence(self) -> str:
        """The smallest error, of which method."""
        return estimated(self.rows)

    def __getitem__(self, flight: str) -> dict[str, pd.DataFrame]:
        """{method: trajectory} of one flight, the motion capture under ``truth``."""
        names = list(dict.fromkeys(name for found in self.trajectories.values() for name in found))
        place_of(flight, names)
        return {method: found[flight] for method, found in self.trajectories.items() if flight in found}

    def plot(self, flight: str | None = None) -> Any:
        """Draw the paths of one flight from above, of every method and the motion capture.

        For blackouts, which score windows, it draws the error over the time since the last pose.

        Parameters
        ----------
        flight : str, optional
            Its name; by default the first.

        Returns
        -------
        plotly.graph_objects.Figure
            Needs the extra ``report``.
        """
        from .figures_of_results import end_errors_figure, paths_figure

        names = list(next(iter(self.trajectories.values()), {}))
        if not names and flight is None:
            return end_errors_figure(self.metrics)
        chosen = flight or names[0]
        return paths_figure(self[chosen], chosen)

    def __repr__(self) -> str:
        lines = []
        for row in self.rows:
            if row.group == "all":
                shown = next(((m, row.metrics[m]) for m in SHOWN_FIRST if m in row.metrics), None)
                what = f"{shown[0]} {shown[1].mean:.4g}" if shown and shown[1].mean is not None else "no metric"
                lines.append(f"{row.method}: {what} (n = {row.n} flights, {row.protocol}, clock {row.clock})")
        return "\n".join(lines) or "no row"

    def _repr_html_(self) -> str:
        found: str = self.metrics.to_html(max_rows=60)
        return found


def table_of(rows: Iterable[EstimateRow]) -> pd.DataFrame:
    """``Estimates.table`` of rows, with paired ratios to another method if there are several."""
    import pandas as pd

    found = []
    for row in rows:
        for metric, s in row.metrics.items():
            low, high = s.ci95 or (None, None)
            ratio = None if row.ratios is None else row.ratios.ratio.get(metric)
            between = (None if row.ratios is None else row.ratios.ci95.get(metric)) or (None, None)
            found.append((row.protocol, row.method, row.group, metric, s.mean, low, high, s.median, s.p90, s.n,
                          s.sessions, ratio, *between, "" if row.ratios is None else row.ratios.to, row.given,
                          row.clock, s.ci_why))
    return pd.DataFrame(found, columns=["protocol", "method", "group", "metric", "mean", "ci95_low", "ci95_high",
                                        "median", "p90", "n", "sessions", "ratio", "ratio_low", "ratio_high",
                                        "compared_with", "given", "clock", "ci_why"])


@speaks_python
def estimate(flights: Flight | Iterable[Flight], method: Any = "drag_ekf", protocol: str = "aided",
             clock: str = "as-recorded", seed: int = 0) -> Estimates:
    """Run estimators on flights and score them against motion capture.

    Parameters
    ----------
    flights : Flight or iterable of Flight
        As ``nb.load`` gives them.
    method : str, Estimator or list of them
        A registered name (``nanobench estimate --list``), or an object or class behind the ``Estimator`` protocol.
    protocol : str
        ``aided`` (ten noisy poses a second), ``blackout`` (no pose after t0), ``whole-flight`` (no pose after
        take-off), ``clean`` (the logged estimate) or ``as-published``.
    clock : str
        ``as-recorded``, ``offset`` (a constant per flight removed) or ``retimed`` (a moving error removed).
    seed : int
        Of everything random. The same seed gives the same result.

    Returns
    -------
    Estimates
        Metrics with intervals, and the trajectories: position in m, quaternion x y z w, in the frame of the motion
        capture.

    Raises
    ------
    UsageError
        For an unknown name.
    InputError
        Where no flight can be scored.

    Examples
    --------
    >>> import nanobench_tools as nb
    >>> found = nb.estimate(nb.simulate(2, seed=1, seconds=12.0), "drag_ekf")
    >>> bool(found.metrics.loc["drag_ekf", "ate_rmse_m"] < 0.1)
    True
    """
    read = some(flights)
    check_protocol(protocol)
    with tempfile.TemporaryDirectory() as folder:
        options = given(read, out=Path(folder), clock=clock, seed=seed)
        methods = as_methods("estimators", method)
        audits, _ = options.audit(read)
        body = estimate_body(options, see(options, read, audits), (protocol,), methods)
        if not body.rows:
            raise NanobenchError(options.failed[0]["error"] if options.failed else "no flight was scored")
        starts = {flight.name: flight.epoch_s for flight in read}
        return Estimates(tuple(body.rows), _trajectories(Path(folder) / "trajectories", starts), tuple(options.failed))


@speaks_python
def compare(flights: Flight | Iterable[Flight], methods: Sequence[Any], protocol: str = "aided",
            clock: str = "as-recorded", seed: int = 0) -> pd.DataFrame:
    """Compare estimators on the same flights.

    Parameters
    ----------
    flights : Flight or iterable of Flight
        As ``nb.load`` gives them.
    methods : list
        Two or more methods, each as in ``estimate``.
    protocol, clock, seed
        As in ``estimate``.

    Returns
    -------
    pandas.DataFrame
        A row per method and metric over all flights. ``ratio`` is the mean error over that of ``compared_with`` on
        the same flights, with the interval of the pairs. A method is better where ``ratio_high`` is below one.

    Raises
    ------
    UsageError
        For an unknown name, or fewer than two methods.
    InputError
        Where no flight can be scored.

    Examples
    --------
    >>> import nanobench_tools as nb
    >>> flights = nb.simulate(2, seed=1, seconds=12.0)
    >>> table = nb.compare(flights, ["drag_ekf", "strapdown"])
    >>> sorted(set(table["method"]))
    ['drag_ekf', 'strapdown']
    """
    if isinstance(methods, str) or not isinstance(methods, Sequence) or len(methods) < 2:
        raise UsageError("compare needs a list of two methods or more")
    found = estimate(flights, methods, protocol, clock, seed).table
    return found[found["group"] == "all"].drop(columns="group").reset_index(drop=True)


def _trajectories(folder: Path, starts: Mapping[str, float]) -> dict[str, dict[str, pd.DataFrame]]:
    """Those in ``folder``, their time less the Unix time of the first row of their flight."""
    import numpy as np

    found: dict[str, dict[str, pd.DataFrame]] = {}
    for path in sorted(folder.glob("*/*.tum")):
        rows = np.loadtxt(path, ndmin=2)
        found.setdefault(path.parent.name, {})[path.stem] = frame_of(rows[:, 0] - starts[path.stem], rows[:, 1:8],
                                                                     TRAJECTORY, UNITS)
    return found
