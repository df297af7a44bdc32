"""``nb.diagnose``: where is my simulator wrong."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import UsageError
from ..flight import Flight
from ..physics import Model
from .quiet_options import given, some

if TYPE_CHECKING:
    import pandas as pd

    from identification.mismatch.verdict import Verdict


class Diagnosis:
    """A verdict on a simulator. ``verdict`` has everything that verdict.json holds."""

    def __init__(self, verdict: Verdict) -> None:
        self.verdict = verdict
        self._body: Mapping[str, Any] = verdict.to_json()

    @property
    def outcome(self) -> str:
        """``named`` | ``unknown`` | ``none`` | ``data_fault`` | ``insufficient``."""
        found: str = self._body["outcome"]
        return found

    @property
    def sentence(self) -> str:
        """What is wrong, how sure, and what it does to predictions of flights left out."""
        from identification.mismatch.headline import headline

        return headline(self._body)

    @property
    def paragraph(self) -> str:
        """The whole verdict in words: sizes, intervals, what else it could be, what would tell."""
        found: str = self._body["paragraph"]
        return found

    @property
    def good_for(self) -> dict[str, str]:
        """{hover, mpc, learning: yes | no | cannot say} of the simulator as it is."""
        from identification.mismatch.headline import good_for

        return dict(good_for(self._body["improvement"]))

    @property
    def findings(self) -> pd.DataFrame:
        """One row per parameter of what was named: term, confidence, believed and found value with interval, unit."""
        import pandas as pd

        rows = [(f["term"], ", ".join(f["equivalent"]), f["confidence"], name, p["believed"], p["value"], *p["ci95"],
                 p["unit"]) for f in self._body["findings"] for name, p in f["parameters"].items()]
        return pd.DataFrame(rows, columns=["term", "or", "confidence", "parameter", "believed", "value", "ci95_low",
                                           "ci95_high", "unit"])

    @property
    def improvement(self) -> pd.DataFrame:
        """Errors of predictions of flights left out: index steps of 10 ms, before and after, by quantity."""
        import pandas as pd

        found = self._body["improvement"] or {}
        steps = [h for h in found if h.isdigit()]
        rows = [(int(h), q, found[h]["before"][q], found[h]["after"][q]) for h in steps for q in found[h]["before"]]
        return pd.DataFrame(rows, columns=["steps", "quantity", "before", "after"]).set_index(["steps", "quantity"])

    @property
    def corrected(self) -> Model | None:
        """The simulator with what was named; None where nothing was."""
        return self.verdict.corrected

    def to_toml(self, path: str | os.PathLike[str]) -> None:
        """Writes the corrected simulator. UsageError where nothing was named."""
        from ..physics.simulator import write_simulator

        if self.corrected is None:
            raise UsageError("nothing was named, so there is no corrected simulator")
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


def diagnose(flights: Flight | Iterable[Flight], simulator: Model | str | os.PathLike[str], seed: int = 0) -> Diagnosis:
    """Compares a simulator with flights: what it leaves out, how large, how sure, and what mending it brings.

    simulator: a ``Model``, or the path of a simulator.toml. A wandering clock is re-timed and faults of the data are
    left out first. InputError for recordings of a vehicle with another number of rotors.

    >>> import nanobench_tools as nb
    >>> flights = nb.simulate(2, seed=1, seconds=12.0)
    >>> believed = nb.fit(flights, ["thrust_voltage", "inertia", "motor_lag"]).greybox.model_
    >>> found = nb.diagnose(flights, believed)
    >>> found.outcome in ("named", "unknown", "none", "data_fault")
    True
    """
    from dataclasses import replace

    from identification.mismatch.diagnosis import diagnose as diagnosed
    from identification.mismatch.recordings import look_over

    from ..physics.simulator import read_simulator

    model = simulator if isinstance(simulator, Model) else read_simulator(Path(simulator))
    read = some(flights)
    options = given(read)
    audits, _ = options.audit(read)
    moved = replace(options, clock="joint").see_on_clock(read, audits)
    kept = [f for f in read if f.name in audits]
    recordings = look_over(kept, audits, moved.flights, moved.audits, "thrust_voltage" in model, model.vehicle)
    return Diagnosis(diagnosed(recordings, model, seed=seed))
