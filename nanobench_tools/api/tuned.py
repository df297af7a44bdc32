"""``nb.tune``: gains of a controller, searched on some plants and paths and judged on others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from ..errors import InputError, NanobenchError
from ..steps.gain_search import GivenPlant, Outcome, Search, Tuned, gains_toml, paths, tune_gains
from ..steps.options import cores
from .quiet_options import given, speaks_python

if TYPE_CHECKING:
    import pandas as pd


class Simulator(Protocol):
    """A fitted vehicle, such as ``nb.fit`` gives."""

    def to_toml(self) -> str: ...


@dataclass(frozen=True, repr=False)
class Tuning:
    """Gains that were searched, and how they compare with the controller's own.

    Attributes
    ----------
    tuned : Tuned
        As in tune.json.
    outcome : Outcome
        Scores of the plants and paths that judge.
    plant : GivenPlant
        The simulator that was flown.
    """

    tuned: Tuned
    outcome: Outcome
    plant: GivenPlant

    @property
    def gains(self) -> dict[str, float]:
        """The gains that were found, by name; those of the controller if no better ones were found."""
        return dict(self.tuned.gains or self.tuned.start)

    @property
    def before(self) -> dict[str, float]:
        """The controller's gains before the search, by name."""
        return dict(self.tuned.start)

    @property
    def sentence(self) -> str:
        """Whether the gains are better on plants and paths not searched on, and by how much."""
        return self.tuned.sentence

    @property
    def table(self) -> pd.DataFrame:
        """One row a judging path: median RMSE over the plants before and after [m], and how many vehicles were lost."""
        import numpy as np
        import pandas as pd

        return pd.DataFrame([{
            "reference": row["reference"], "speed_m_s": row["speed_m_s"],
            **{f"rmse_{when}_m": float(np.median(np.array(row[f"{when}_m"], float))) for when in ("before", "after")},
            **{f"lost_{when}": sum(row[f"lost_{when}"]) for when in ("before", "after")}} for row in self.tuned.rows()])

    def to_toml(self) -> str:
        """The gains as a file that ``nanobench control --gains`` reads."""
        return gains_toml(self.tuned, self.plant)

    def __repr__(self) -> str:
        return self.sentence

    def _repr_html_(self) -> str:
        found: str = self.table.to_html(index=False)
        return found


@speaks_python
def tune(controller: str, simulator: str | Path | Simulator | None = None, trajectory: Sequence[str] = (),
         judge: Sequence[str] = (), speed: Sequence[float] = (), seconds: float = 7.5, plants: int = 8,
         radio_delay_s: float = 0.03, budget: int = 120, seed: int = 0) -> Tuning:
    """Search the gains of a registered controller on simulated plants, and judge them on others.

    Parameters
    ----------
    controller : str
        Registered name of a controller with gains.
    simulator : path, VehicleModel or None
        A simulator.toml, the result of ``nb.fit``, or None for the shipped vehicle.
    trajectory, judge : list of str
        Families of paths to search and to judge on; empty: the usual ones.
    speed : list of float
        Of the paths, m/s.
    seconds : float
        Length of each path, s.
    plants : int
        Number to search on; twice as many others judge.
    radio_delay_s : float
        Of the command, s.
    budget : int
        Trials.
    seed : int
        Of everything random. The same seed gives the same result.

    Returns
    -------
    Tuning
        Gains, and a row per path that judged.

    Raises
    ------
    UsageError
        For a controller without gains, or a family in both lists.
    InputError
        For a simulator that no controller can fly.
    NanobenchError
        Where a flight failed.

    Examples
    --------
    >>> nb.tune("mellinger").table  # doctest: +SKIP
    """
    searched, judged = paths(trajectory, judge, speed, seconds)
    plant = GivenPlant.shipped() if simulator is None else GivenPlant.of(*_text_of(simulator))
    options = given(jobs=cores(), seed=seed)
    tuned = tune_gains(options, Search(controller, searched, judged, plants, radio_delay_s, budget), plant)
    if tuned.outcome is None:
        raise NanobenchError(options.failed[0]["error"] if options.failed else tuned.sentence)
    return Tuning(tuned, tuned.outcome, plant)


def _text_of(simulator: str | Path | Simulator) -> tuple[str, str]:
    """(text of a simulator.toml, its origin)."""
    if not isinstance(simulator, (str, Path)):
        return simulator.to_toml(), "a fitted vehicle"
    try:
        return Path(simulator).read_text(encoding="utf-8"), str(simulator)
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(str(simulator), f"cannot be read ({error})", "give the path of a simulator.toml") from None
