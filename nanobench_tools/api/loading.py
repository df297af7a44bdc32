"""``nb.load`` and ``nb.load_flight``: recordings as a list of flights with a table as its ``repr``."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, overload

from ..errors import InputError, did_you_mean
from ..flight import Flight
from ..results.flight_figure import named_in
from .quiet_options import given, in_python, speaks_python

if TYPE_CHECKING:
    import pandas as pd

Place = str | os.PathLike[str]
LONGEST_NAME = 40
"""Characters of a flight's name in the ``repr`` of a table."""


def place_of(name: str, names: Sequence[str]) -> int:
    """Where ``name`` is in ``names``; KeyError with the nearest one."""
    if name not in names:
        raise KeyError(f"no flight {name!r}; {did_you_mean(name, names)}there are {named_in(names)}")
    return list(names).index(name)


def short_table(table: pd.DataFrame) -> str:
    """A table with a row per flight as text for a prompt: at most twelve rows, long names and texts shortened."""
    def short(name: str) -> str:
        return name if len(name) <= LONGEST_NAME else f"{name[:LONGEST_NAME - 3]}..."

    text: str = table.rename(index=short).to_string(max_rows=12, max_colwidth=60)
    return text


class Flights(Sequence[Flight]):
    """Flights in the order of their paths.

    ``flights[0]`` and ``flights["name"]`` give a flight, ``flights[2:5]`` some.

    Attributes
    ----------
    failed : list of dict
        Files that are no recording: path and error.
    """

    def __init__(self, flights: Iterable[Flight], failed: Sequence[dict[str, str]] = ()) -> None:
        self._flights = list(flights)
        self.failed = list(failed)

    @overload
    def __getitem__(self, key: int | str) -> Flight: ...
    @overload
    def __getitem__(self, key: slice) -> Flights: ...
    def __getitem__(self, key: int | str | slice) -> Flight | Flights:
        if isinstance(key, slice):
            return Flights(self._flights[key])
        return self._flights[key if isinstance(key, int) else place_of(key, self.names)]

    def __len__(self) -> int:
        return len(self._flights)

    def __iter__(self) -> Iterator[Flight]:
        return iter(self._flights)

    @property
    def names(self) -> list[str]:
        """Names of the flights, in their order."""
        return [flight.name for flight in self._flights]

    @property
    def table(self) -> pd.DataFrame:
        """One row per flight: source, length in s, streams, REAL or SYNTHETIC."""
        import pandas as pd

        rows = [(f.provenance.source, round(f.duration_s, 1), " ".join(f.streams),
                 "SYNTHETIC" if f.provenance.synthetic else "REAL") for f in self._flights]
        return pd.DataFrame(rows, index=pd.Index(self.names, name="flight"),
                            columns=["source", "length_s", "streams", "data"])

    def __repr__(self) -> str:
        return f"{self._head()}\n{short_table(self.table)}" if self._flights else self._head()

    def _repr_html_(self) -> str:
        return f"<p>{self._head()}</p>{self.table.to_html(max_rows=20)}" if self._flights else f"<p>{self._head()}</p>"

    def _head(self) -> str:
        failed = f", {len(self.failed)} files failed (see .failed)" if self.failed else ""
        return f"{len(self)} flight{'s' * (len(self) != 1)}{failed}"


@speaks_python
def load(path: Place | Sequence[Place] | None = None, columns: Place | None = None) -> Flights:
    """Read every recording below a path.

    Parameters
    ----------
    path : path or list of paths, optional
        A file, a folder, or several. None: the default places ($NANOBENCH_DATA, ./data).
    columns : path, optional
        A column map (TOML) for tables of your own; ``nanobench columns FILE`` drafts one.

    Returns
    -------
    Flights
        In the order of their paths. A file that cannot be read is listed in ``failed`` and stops nothing.

    Raises
    ------
    InputError
        Where no recording is found.

    Examples
    --------
    >>> import nanobench_tools as nb
    >>> from nanobench_tools.sources import write_nanobench
    >>> import pathlib, tempfile
    >>> folder = pathlib.Path(tempfile.mkdtemp())
    >>> for flight in nb.simulate(2, seed=1, seconds=12.0):
    ...     _ = write_nanobench(flight, folder / f"{flight.name}.csv")
    >>> len(nb.load(folder))
    2
    """
    places = [] if path is None else [path] if isinstance(path, (str, os.PathLike)) else list(path)
    options = given(data=tuple(Path(place) for place in places), columns=None if columns is None else Path(columns))
    flights = options.load()
    return Flights(flights, [{"path": f["file"], "error": in_python(f["error"])} for f in options.failed])


@speaks_python
def load_flight(file: Place, columns: Place | None = None) -> Flight:
    """Read one recording.

    Parameters
    ----------
    file : path
        Of the recording.
    columns : path, optional
        A column map (TOML) for a table of your own.

    Returns
    -------
    Flight
        Streams in SI units; times in s from the first row.

    Raises
    ------
    InputError
        Names the file and what is wrong with it; more than one recording is an error, too.

    Examples
    --------
    >>> import nanobench_tools as nb
    >>> from nanobench_tools.sources import write_nanobench
    >>> import pathlib, tempfile
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "flight.csv"
    >>> _ = write_nanobench(nb.simulate(2, seed=1, seconds=12.0)[0], file)
    >>> flight = nb.load_flight(file)
    >>> flight["imu"].to_pandas()["gyro_x"].columns.tolist()
    ['rad/s']
    """
    found = load(file, columns)
    if len(found) > 1:
        raise InputError(os.fspath(file), f"holds {len(found)} recordings", "use load for a folder")
    return found[0]
