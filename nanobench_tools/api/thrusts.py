"""``nb.thrust``: thrust of a motor from its command and the battery, from stand tables or flights."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import UsageError
from ..flight import Flight
from .quiet_options import given, some, speaks_python

if TYPE_CHECKING:
    import pandas as pd

    from identification.thrust.thrust_formula import ThrustFormula
    from identification.thrust.thrust_model import ThrustModel
    from identification.thrust.thrust_result import FlightResult, StandResult, ThrustResult


class Thrust:
    """Thrust maps of recordings.

    With thrust-stand tables and flights together, the map of the flights is used, because it describes the vehicle in
    flight. ``thrust(command, battery_V)`` is short for ``thrust.thrust_N(command, battery_V)``.

    Attributes
    ----------
    result : ThrustResult
        As in thrust.json.
    """

    def __init__(self, result: ThrustResult, model: ThrustModel | None, sentence: str, assumed: str = "") -> None:
        self.result, self._model, self._sentence, self._assumed = result, model, sentence, assumed

    @property
    def table(self) -> pd.DataFrame:
        """Error of every map.

        Index: (kind, model, split, clock). Columns: rms, ci95_low, ci95_high and bias in ``unit``, n rows, files,
        status.
        """
        import pandas as pd

        rows = [(r.kind, r.model, r.split, r.clock, r.rms, *(r.ci95 or (np.nan, np.nan)), r.bias,
                 "N per motor" if r.kind == "stand" else "m/s^2", r.n, r.files, r.status) for r in self.result.rows]
        return pd.DataFrame(rows, columns=["kind", "model", "split", "clock", "rms", "ci95_low", "ci95_high", "bias",
                                           "unit", "n", "files", "status"]).set_index(
            ["kind", "model", "split", "clock"])

    @property
    def best(self) -> str | None:
        """Name of the map in use; None if no map is valid."""
        return self.result.best

    @property
    def formula(self) -> str:
        """The map in use with numbers and units: T [N] of one motor, u = PWM / 65535, V battery voltage [V]."""
        return self._formula().text

    @property
    def levels(self) -> pd.DataFrame:
        """Hover and full command with a full and an empty battery.

        Index: battery. Columns: voltage_V, hover_pwm (nan: no hover), full_N per motor at full command,
        thrust_to_weight there,
        and whether rows of that voltage were measured.
        """
        import pandas as pd

        rows = [(x.battery, x.voltage_V, np.nan if x.hover_pwm is None else x.hover_pwm, x.full_N, x.thrust_to_weight,
                 x.measured) for x in self._formula().levels]
        return pd.DataFrame(rows, columns=["battery", "voltage_V", "hover_pwm", "full_N", "thrust_to_weight",
                                           "measured"]).set_index("battery")

    @property
    def parameters_(self) -> pd.DataFrame:
        """One row per parameter of the map in use: value, ci95_low, ci95_high (nan without an interval), unit."""
        import pandas as pd

        found = self.result.parameters.get(self.best or "", {})
        rows = [(p.value, *(p.ci95 or (np.nan, np.nan)), p.unit) for p in found.values()]
        return pd.DataFrame(rows, index=pd.Index(list(found), name="parameter"),
                            columns=["value", "ci95_low", "ci95_high", "unit"])

    @property
    def sentence(self) -> str:
        """The map in use, how far off it is on files it was not fitted to, and what it gives at hover and full
        command."""
        return self._sentence if self.best is None else f"{self._sentence}. {self._formula().described(self._assumed)}"

    def thrust_N(self, command: ArrayLike, battery_V: ArrayLike) -> np.ndarray:
        """Return the thrust of one motor in hover.

        Parameters
        ----------
        command : array_like
            PWM ratio, 0 to 1.
        battery_V : array_like
            Voltage under load, V. Both are broadcast.

        Returns
        -------
        ndarray
            N per motor.

        Raises
        ------
        UsageError
            For commands outside 0 to 1, or without a valid map.
        """
        return self._in_use().predict(command, battery_V)

    def command(self, thrust_N: ArrayLike, battery_V: ArrayLike) -> np.ndarray:
        """Return the command at which one motor gives a thrust.

        Parameters
        ----------
        thrust_N : array_like
            N per motor.
        battery_V : array_like
            Voltage under load, V. Both are broadcast.

        Returns
        -------
        ndarray
            PWM ratio; 1 where the battery cannot give that much.

        Raises
        ------
        UsageError
            Without a valid map.
        """
        return self._in_use().inverse(np.asarray(thrust_N, float), np.asarray(battery_V, float)).pwm

    __call__ = thrust_N

    def plot(self) -> Any:
        """A plotly figure: thrust of one motor over its command at the battery voltages of the recordings."""
        from .figures_of_results import thrust_figure

        chosen = self._part().chosen
        if chosen is None:
            return thrust_figure("none", (), ())
        return thrust_figure(str(self.best), chosen.curves, chosen.points if self.result.flight is None else ())

    def __repr__(self) -> str:
        return self.sentence

    def _repr_html_(self) -> str:
        from markupsafe import escape

        return f"<p>{escape(self.sentence)}</p>{self.table.to_html()}"

    def _part(self) -> StandResult | FlightResult:
        found = self.result.flight or self.result.stand
        assert found is not None  # one of both was found
        return found

    def _formula(self) -> ThrustFormula:
        chosen = self._part().chosen
        if chosen is None:
            raise UsageError("no map is a result, so there is no formula; .table shows what is wrong with each")
        return chosen.formula

    def _in_use(self) -> ThrustModel:
        if self._model is None:
            raise UsageError("no map is a result, so there is no thrust; .table shows what is wrong with each")
        return self._model


@speaks_python
def thrust(recordings: Flight | Iterable[Flight], test: Flight | Iterable[Flight] = (),
           mass_kg: float | None = None, seed: int = 0) -> Thrust:
    """Fit thrust to PWM and battery voltage, and choose the map that predicts other recordings best.

    Parameters
    ----------
    recordings : Flight or iterable of Flight
        Flights, or tables of a thrust stand, as ``nb.load`` reads them.
    test : Flight or iterable of Flight
        Others to score on, instead of the usual split.
    mass_kg : float, optional
        Of the vehicle; free flight shows thrust over mass only. Without it 0.04085 is assumed.
    seed : int
        Of everything random. The same seed gives the same result.

    Returns
    -------
    Thrust
        Thrust of one motor in N from a command of 0 to 1 and a voltage in V, and the reverse.

    Raises
    ------
    InputError
        Where no map can be fitted.

    Examples
    --------
    >>> import nanobench_tools as nb
    >>> found = nb.thrust(nb.simulate(3, seed=1, seconds=12.0))
    >>> found.formula.startswith("T = ")
    True
    >>> bool(0.05 < found.thrust_N(0.7, 3.8) < 0.2)
    True
    """
    from identification.thrust.flight_fit import models
    from identification.thrust.thrust_model import ThrustModel

    from ..physics.vehicle import Vehicle
    from ..steps.thrusting import thrust_maps, thrust_sentence

    assumed = "mass_kg" if mass_kg is None else ""
    mass_kg = Vehicle().mass_kg if mass_kg is None else mass_kg
    models(mass_kg)  # report an invalid mass before anything is fitted
    train, held_out = some(recordings), list([test] if isinstance(test, Flight) else test)
    options = given([*train, *held_out], seed=seed)
    found, parts = thrust_maps(options, [*train, *held_out], (train, held_out) if held_out else None, mass_kg)
    part = next((p for p in parts if p.kind == "flight"), parts[0])
    model = None if part.result.best is None else ThrustModel(mass_kg=mass_kg, seed=seed).use(part.found)
    return Thrust(found, model, thrust_sentence(found), assumed)
