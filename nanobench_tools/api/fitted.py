"""``nb.fit``: a model of physical terms from flights."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import UsageError
from ..flight import Flight
from ..methods import Prediction, Windows
from .quiet_options import some

if TYPE_CHECKING:
    import control
    import pandas as pd

    from identification.greybox.fit import GreyBox


class VehicleModel:
    """A fitted vehicle. ``greybox`` is what fitted it, ``trouble`` why it is no result (empty: it is one)."""

    def __init__(self, greybox: GreyBox) -> None:
        self.greybox = greybox

    @property
    def parameters_(self) -> pd.DataFrame:
        """Index name; value, ci95_low, ci95_high (nan without an interval), unit, and why there is no interval."""
        import pandas as pd

        rows = [(p.value, *(p.ci95 or (float("nan"),) * 2), p.unit, p.ci_why)
                for p in self.greybox.parameters_.values()]
        return pd.DataFrame(rows, index=pd.Index(list(self.greybox.parameters_), name="parameter"),
                            columns=["value", "ci95_low", "ci95_high", "unit", "ci_why"])

    @property
    def trouble(self) -> str:
        return self.greybox.result_.trouble

    def predict(self, windows: Windows) -> Prediction:
        """States 1..H steps after the start of every window."""
        return self.greybox.predict(windows)

    def score(self, flights: Flight | Iterable[Flight]) -> pd.DataFrame:
        """Mean errors of its predictions on ``flights`` after 1, 10 and 50 steps of 10 ms (rows: quantities)."""
        import pandas as pd

        return pd.DataFrame(self.greybox.score(some(flights))).T

    def summary(self) -> str:
        """Parameters with units and intervals, and all that has to be said beside them."""
        return self.greybox.result_.summary()

    def plot(self) -> Any:
        """A plotly figure of the intervals."""
        return self.greybox.result_.plot()

    def linearize(self, battery_V: float = 3.7) -> control.StateSpace:
        """The vehicle about its hover for python-control (extra ``control``): inputs ``motor_1`` .. [PWM ratio],
        outputs position, velocity, turn, rate and thrust by name [m, m/s, rad, rad/s, N]; a delay by Pade.

        >>> import nanobench_tools as nb
        >>> terms = ["thrust_voltage", "motor_lag", "inertia"]
        >>> vehicle = nb.fit(nb.simulate(2, seed=1, seconds=12.0), terms=terms).linearize()
        >>> vehicle.output_labels[9:12]
        ['rate_x', 'rate_y', 'rate_z']
        """
        from ..physics.linear import linearize

        return linearize(self.greybox.model_, battery_V)

    def to_toml(self, path: str | os.PathLike[str] | None = None) -> str:
        """The vehicle as simulator.toml, written to ``path`` where one is given. UsageError for a fit that is none."""
        from ..physics.simulator import dumps, write_simulator

        if self.trouble:
            raise UsageError(f"this fit is no vehicle: {self.trouble}")
        if path is not None:
            write_simulator(self.greybox.model_, Path(path))
        return dumps(self.greybox.model_)

    def __repr__(self) -> str:
        result = self.greybox.result_
        return (f"VehicleModel of {result.n_flights} flights, {len(result.parameters)} parameters"
                + (f"; NO RESULT: {self.trouble}" if self.trouble else ""))

    def _repr_html_(self) -> str:
        from markupsafe import escape

        return f"<p>{escape(repr(self))}</p>{self.parameters_.to_html()}"


def fit(flights: Flight | Iterable[Flight], terms: Sequence[str] | Mapping[str, Mapping[str, Any]] | None = None,
        mass_kg: float = 0.04085, seed: int = 0) -> VehicleModel:
    """Fits physical terms to what they predict half a second ahead; intervals over sessions and flights.

    terms: names of effects (``nanobench sysid --list``; None: thrust by voltage, lag, drag, moments). mass_kg: of the
    scale, since flights tell only ratios to it. InputError where the flights cannot tell anything.

    >>> import nanobench_tools as nb
    >>> model = nb.fit(nb.simulate(2, seed=1, seconds=12.0), terms=["thrust_voltage", "motor_lag", "inertia"])
    >>> bool(model.parameters_.loc["thrust_voltage.c[0]", "value"] > 0)
    True
    """
    from identification.greybox.fit import GreyBox

    from ..physics import Vehicle
    from ..physics.vehicle import BOUNDS

    low, high = BOUNDS["mass_kg"]
    if not low <= mass_kg <= high:
        raise UsageError(f"mass_kg {mass_kg:g} is outside {low:g} to {high:g}; is it in grams?")
    what: dict[str, Any] = {} if terms is None else {"terms": terms}
    return VehicleModel(GreyBox(vehicle=Vehicle(mass_kg=mass_kg), seed=seed, **what).fit(some(flights)))
