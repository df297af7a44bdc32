"""``nb.control``: how well was it flown, by the controllers that flew."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..flight import Flight
from ..results.result import to_json
from ..steps.controlling import control_body
from ..steps.result_bodies import ControlBody
from ..steps.sentences import controlled
from .quiet_options import given, some, speaks_python

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, repr=False)
class Tracking:
    """Scores of the controllers that flew.

    Attributes
    ----------
    body : ControlBody
        As in control.json.
    failed : tuple of dict
        Flights that failed: item, file and error.
    """

    body: ControlBody
    failed: tuple[dict[str, str], ...]

    @property
    def sentence(self) -> str:
        """The RMSE of each controller along the path with most flights."""
        return controlled(self.body)

    @property
    def table(self) -> pd.DataFrame:
        """One row per protocol, path, speed and controller. Columns: n flights, means of the metrics (SI units as in
        the name), and the 95 % interval of the RMSE.

        The interval is nan where it cannot be computed."""
        import pandas as pd

        found = []
        for row in self.body.rows:
            content = to_json(row)
            ends = content["statistics"]["rmse_m"]["ci95"] or (float("nan"),) * 2
            found.append({**{key: content[key] for key in ("protocol", "reference", "speed", "controller", "n")},
                          **content["metrics"], "rmse_m_low": ends[0], "rmse_m_high": ends[1]})
        return pd.DataFrame(found)

    def plot(self) -> Any:
        """A plotly figure: RMSE by path and controller, with its interval."""
        from .figures_of_results import tracking_figure

        return tracking_figure(self.table)

    def __repr__(self) -> str:
        return self.sentence or "no row"

    def _repr_html_(self) -> str:
        found: str = self.table.to_html(index=False, max_rows=60)
        return found


@speaks_python
def control(flights: Flight | Iterable[Flight], protocol: str | Sequence[str] = "clean", clock: str = "as-recorded",
            seed: int = 0) -> Tracking:
    """Score how well recorded flights followed their set-points, by path, speed and controller.

    Parameters
    ----------
    flights : Flight or iterable of Flight
        As ``nb.load`` gives them.
    protocol : str or list of str
        ``clean`` (the phase in which a path was streamed), ``as-published``, or both.
    clock : str
        ``as-recorded``, ``offset`` (a constant per flight removed) or ``retimed`` (a moving error removed).
    seed : int
        Of everything random. The same seed gives the same result.

    Returns
    -------
    Tracking
        Errors in m and m/s with intervals.

    Raises
    ------
    InputError
        Where no flight can be scored.

    Examples
    --------
    >>> import nanobench_tools as nb
    >>> found = nb.control(nb.simulate(2, seed=1, seconds=12.0))
    >>> bool((found.table["rmse_m"] > 0.0).all())
    True
    """
    read = some(flights)
    options = given(read, clock=clock, seed=seed)
    audits, _ = options.audit(read)
    protocols = (protocol,) if isinstance(protocol, str) else tuple(protocol)
    body = control_body(options, *options.on_clock(read, audits), protocols)
    return Tracking(body, tuple(options.failed))
