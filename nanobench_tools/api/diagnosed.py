"""``nb.diagnose``: where is my simulator wrong."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import UsageError
from ..flight import Flight
from ..physics import Model
from .fitted import VehicleModel
from .loading import load
from .quiet_options import given, in_python, some, speaks_python

if TYPE_CHECKING:
    import pandas as pd

    from identification.mismatch.verdict import Verdict


class Diagnosis:
    """A verdict on a simulator.

    Attributes
    ----------
    verdict : Verdict
        Everything; ``verdict.to_json()`` is the content of verdict.json.
    """

    def __init__(self, verdict: Verdict) -> None:
        self.verdict = verdict
        self._body: Mapping[str, Any] = verdict.to_json()

    @property
    def outcome(self) -> str:
        """``named`` (effects identified), ``unknown``, ``none``, ``data_fault`` or ``insufficient``."""
        found: str = self._body["outcome"]
        return found

    @property
    def sentence(self) -> str:
        """The omitted effects, their confidence, and their effect on predictions of flights left out."""
        from identification.mismatch.headline import headline

        return in_python(headline(self._body))

    @property
    def paragraph(self) -> str:
        """The whole verdict in words: sizes, intervals, alternatives, and the flights that would separate them."""
        return in_python(self._body["paragraph"])

    @property
    def good_for(self) -> dict[str, str]:
        """By use (hover, mpc, learning): yes, no or cannot say, for the simulator as given."""
        from identification.mismatch.headline import good_for

        return dict(good_for(self._body["improvement"]))

    @property
    def findings(self) -> pd.DataFrame:
        """One row per parameter of an identified effect.

        Columns: term, or (indistinguishable ones), confidence (0 to 1), parameter, believed (the simulator's value),
        value,
        ci95_low, ci95_high, unit.
        """
        import pandas as pd

        rows = [(f["term"], ", ".join(f["equivalent"]), f["confidence"], name, p["believed"], p["value"], *p["ci95"],
                 p["unit"]) for f in self._body["findings"] for name, p in f["parameters"].items()]
        return pd.DataFrame(rows, columns=["term", "or", "confidence", "parameter", "believed", "value", "ci95_low",
                                           "ci95_high", "unit"])

    @property
    def improvement(self) -> pd.DataFrame:
        """Mean errors of predictions of flights left out.

        Index: (steps of 10 ms, quantity), whose unit is in its name. Columns: before and after the correction.
        """
        import pandas as pd

        found = self._body["improvement"] or {}
        steps = [h for h in found if h.isdigit()]
        rows = [(int(h), q, found[h]["before"][q], found[h]["after"][q]) for h in steps for q in found[h]["before"]]
        return pd.DataFrame(rows, columns=["steps", "quantity", "before", "after"]).set_index(["steps", "quantity"])

    @property
    def corrected(self) -> Model | None:
        """The simulator with the identified effects; None if no effect was identified."""
        return self.verdict.corrected

    def to_toml(self, path: str | os.PathLike[str]) -> None:
        """Write the corrected simulator.

        Parameters
        ----------
        path : path
            Of the simulator.toml.

        Raises
        ------
        UsageError
            If no effect was identified.
        """
        from ..physics.simulator import write_simulator

        if self.corrected is None:
            raise UsageError("no effect was identified, so there is no corrected simulator")
        write_simulator(self.corrected, Path(path))

    def plot(self) -> Any:
        """A plotly figure: error of predictions of flights left out, before and after."""
        from .figures_of_results import improvement_figure

        return improvement_figure(self.improvement)

    def __repr__(self) -> str:
        return f"{self.outcome}: {self.sentence}"

    def _repr_html_(self) -> str:
        from markupsafe import escape

        return f"<p>{escape(repr(self))}</p>{self.findings.to_html(index=False)}"


Believed = Model | VehicleModel | Callable[..., Any] | str | os.PathLike[str] | Flight | Iterable[Flight]
"""What a simulator may be given as, see ``diagnose``."""


@speaks_python
def diagnose(flights: Flight | Iterable[Flight], simulator: Believed, seed: int = 0,
             mass_kg: float = 0.04085, engine: str = "posterior") -> Diagnosis:
    """Compare a simulator with flights: omitted effects, their size and confidence, and the gain of correcting them.

    A wandering clock is re-timed and faults of the data are left out first.

    Parameters
    ----------
    flights : Flight or iterable of Flight
        As ``nb.load`` gives them.
    simulator
        A model of ``nb.fit``, a ``Model``, or the path of a simulator.toml. Or a callable
        (``nanobench_tools.physics.adapters.given``) or its name (``module:callable``, ``rotorpy``). Or flights that
        the simulator made, as flights or as their folder.
    seed : int
        Of everything random. The same seed gives the same result.
    mass_kg : float
        Mass that a callable, or a simulator known by its flights, was given; flights show only thrust over mass.
    engine : str
        ``posterior``, which weighs every set of up to three effects, or the older ``rules``.

    Returns
    -------
    Diagnosis
        Findings in SI units with 95 % intervals, errors of predictions before and after, the corrected simulator.

    Raises
    ------
    InputError
        For recordings of a vehicle with another number of rotors.

    Examples
    --------
    >>> import nanobench_tools as nb
    >>> flights = nb.simulate(2, seed=1, seconds=12.0)
    >>> found = nb.diagnose(flights, nb.fit(flights, ["thrust_voltage", "inertia", "motor_lag"]))
    >>> found.outcome in ("named", "unknown", "none", "data_fault")
    True
    """
    from ..physics.adapters.given import load_simulator, wrapped
    from ..physics.simulator import read_simulator
    from ..steps.diagnosing import (
        ENGINES,
        Looked,
        against_callable,
        against_model,
        beliefs_of,
        check_installed,
        names_a_file,
    )

    check_installed()
    if engine not in ENGINES:
        raise UsageError(f"engine={engine!r}: give one of {', '.join(ENGINES)}")
    read = some(flights)
    options = given(read, seed=seed)
    if isinstance(simulator, (str, os.PathLike)):
        text = os.fspath(simulator)
        believed: Any = (load(text) if Path(text).is_dir() else read_simulator(Path(text)) if names_a_file(text) else
                     load_simulator(text))
        name = text
    else:
        believed, name = simulator, getattr(simulator, "__name__", type(simulator).__name__)
    if isinstance(believed, VehicleModel):
        believed = believed.model
    elif isinstance(believed, (Flight, Iterable)):
        theirs = some(believed)
        believed = beliefs_of(given(theirs, seed=seed), read, theirs, mass_kg)
    if isinstance(believed, Model):
        recordings = Looked(options, read).at(believed.vehicle, "thrust_voltage" in believed)
        return Diagnosis(against_model(options, recordings, believed, name, engine).verdict)
    return Diagnosis(against_callable(options, read, wrapped(believed, name), name, mass_kg, engine).verdict)
