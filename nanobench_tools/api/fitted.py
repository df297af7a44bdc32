"""``nb.fit``: a vehicle, or a model of chosen physical terms, from flights."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from ..errors import InputError, UsageError
from ..flight import Flight
from ..methods import Prediction, Predictor, Windows
from .quiet_options import some, speaks_python

if TYPE_CHECKING:
    import control
    import pandas as pd

    from identification.greybox.fit_result import FitResult

    from ..physics import Model
    from ..protocols.task1 import Case

VEHICLE_ROW = "simulator.toml"
"""Name of the exported vehicle alone, as in the rows of ``nanobench sysid``."""
TRIMMED_ROW = "simulator.toml + trim"
"""Name of the exported vehicle with the trim of each flight, as in the same rows."""


@dataclass(frozen=True, repr=False)
class FlightPrediction:
    """Half-second predictions of one flight from n starts.

    Attributes
    ----------
    flight, model : str
        Names of both.
    start_s : ndarray
        (n,) s from the first row of the flight.
    predicted, measured : Prediction
        States 1..50 steps of 10 ms later.
    """

    flight: str
    model: str
    start_s: np.ndarray
    predicted: Prediction
    measured: Prediction

    @property
    def table(self) -> pd.DataFrame:
        """Errors by start. Index: start_s. Columns: (quantity, steps of 10 ms), in m, m/s, rad and rad/s."""
        import pandas as pd

        from ..metrics.prediction import HORIZONS, window_errors

        found = {(name, h): error[:, h - 1] for name, error in window_errors(self.predicted, self.measured).items()
                 for h in HORIZONS}
        return pd.DataFrame(found, index=pd.Index(self.start_s, name="start_s"))

    def plot(self) -> Any:
        """A plotly figure: errors after half a second over the time of the flight."""
        from .figures_of_results import prediction_figure

        return prediction_figure(f"{self.flight} by {self.model}: error after half a second", self.table)

    def __repr__(self) -> str:
        if not len(self.start_s):
            return f"{self.flight}: no half second of clean flight to predict"
        error = np.linalg.norm(self.predicted.position_m[:, -1] - self.measured.position_m[:, -1], axis=1).mean()
        return f"{self.flight} by {self.model}: {len(self.start_s)} half seconds, {error:.3f} m off at their end (mean)"


class VehicleModel:
    """A fitted vehicle.

    Attributes
    ----------
    model : Model
        Its physics, as exported.
    result : FitResult
        Parameters, what the flights cannot identify, and whether it flies.
    """

    def __init__(self, model: Model, result: FitResult, predictor: Callable[[], Predictor]) -> None:
        self.model, self.result = model, result
        self._make = predictor
        self._predictor: Predictor | None = None

    @property
    def predictor(self) -> Predictor:
        """The model that predicts flights best; it is fitted at its first use."""
        if self._predictor is None:
            self._predictor = self._make()
        return self._predictor

    @property
    def parameters_(self) -> pd.DataFrame:
        """One row per parameter.

        Columns: value, ci95_low, ci95_high (nan without an interval), unit, prior_share, and ci_why (why there is no
        interval).
        ``prior_share`` is 1 where the flights cannot identify the parameter and its prior is kept, and nan without a
        prior.
        """
        import pandas as pd

        rows = [(p.value, *(p.ci95 or (np.nan, np.nan)), p.unit, np.nan if p.prior_share is None else p.prior_share,
                 p.ci_why) for p in self.result.parameters.values()]
        return pd.DataFrame(rows, index=pd.Index(list(self.result.parameters), name="parameter"),
                            columns=["value", "ci95_low", "ci95_high", "unit", "prior_share", "ci_why"])

    @property
    def trouble(self) -> str:
        """Why the fit is invalid; empty for a valid one."""
        return self.result.trouble

    @property
    def physical(self) -> bool:
        """Whether it is the vehicle that flew, rather than a model of chosen terms."""
        return self.result.thrust_spread is not None

    def predict(self, what: Windows | Flight, by: str = "predictor") -> Prediction | FlightPrediction:
        """Predict states from the start of windows.

        The predictor is fitted to the same flights at the first call.

        Parameters
        ----------
        what : Windows or Flight
            Of a flight, windows start every 0.1 s of clean flight.
        by : str
            ``predictor``: the best predictor (``fit_balanced`` of ``nanobench sysid``). ``vehicle``: the exported
            vehicle alone. ``trimmed``: with the trim of the flight, four gains of the motors from the rows before the
            start.

        Returns
        -------
        Prediction or FlightPrediction
            For windows or for a flight.

        Raises
        ------
        UsageError
            For an unknown ``by``, or a flight without half a second of clean flight.
        """
        known = {"predictor": lambda: self.predictor, "vehicle": self._vehicle, "trimmed": self._trimmed}
        if by not in known or (by == "trimmed" and not self.physical):
            raise UsageError(f"by is {by!r}; it can be predictor or vehicle, or trimmed for a vehicle without terms=")
        predictor = known[by]()
        if isinstance(what, Windows):
            return predictor.predict(what)
        return _predicted(some(what)[0], predictor)

    def score(self, flights: Flight | Iterable[Flight]) -> pd.DataFrame:
        """Score predictions of flights.

        Parameters
        ----------
        flights : Flight or iterable of Flight
            Flights that judge.

        Returns
        -------
        pandas.DataFrame
            Mean errors after 1, 10 and 50 steps of 10 ms, and their sum. Index (model, quantity): the predictor, the
            exported vehicle alone, and with the trim of each flight.

        Raises
        ------
        InputError
            Where no flight can be used, with the reason.
        """
        import pandas as pd

        from identification.greybox.fit_windows import cut, mean_errors

        cases = _cases(some(flights))
        found: dict[tuple[str, str], dict[str, float]] = {}
        for predictor in (self.predictor, self._vehicle(), *([self._trimmed()] if self.physical else [])):
            cuts = cut(cases, past=predictor.information == "past", thin=1)
            found |= {(predictor.name, name): row for name, row in mean_errors(predictor.predict, cuts).items()}
        return pd.DataFrame(found).T.rename_axis(["model", "quantity"])

    def _vehicle(self) -> Predictor:
        from ..physics.predictor import ModelPredictor

        return ModelPredictor(self.model, VEHICLE_ROW)

    def _trimmed(self) -> Predictor:
        from identification.vehicle.trimmed_predictor import TrimmedPredictor

        return cast("Predictor", TrimmedPredictor(self.model, TRIMMED_ROW))

    def summary(self) -> str:
        """Parameters with units and intervals; shows which are priors, and all caveats."""
        return self.result.summary()

    def plot(self) -> Any:
        """A plotly figure of the intervals; priors are marked."""
        return self.result.plot()

    def linearize(self, battery_V: float = 3.7) -> control.StateSpace:
        """Linearise the vehicle about its hover, for python-control (extra ``control``).

        Parameters
        ----------
        battery_V : float
            Battery voltage at hover, V.

        Returns
        -------
        control.StateSpace
            Inputs ``motor_1`` .. [PWM ratio]; outputs position, velocity, turn, rate and thrust by name [m, m/s, rad,
            rad/s, N]. A delay is approximated by Pade.

        Raises
        ------
        MissingExtraError
            Without python-control.

        Examples
        --------
        >>> import nanobench_tools as nb
        >>> vehicle = nb.fit(nb.simulate(2, seed=1, seconds=12.0)).linearize()
        >>> vehicle.output_labels[9:12]
        ['rate_x', 'rate_y', 'rate_z']
        """
        from ..physics.linear import linearize

        return linearize(self.model, battery_V)

    def to_toml(self, path: str | os.PathLike[str] | None = None) -> str:
        """Return the vehicle as simulator.toml.

        Parameters
        ----------
        path : path, optional
            Where to write it, too.

        Returns
        -------
        str
            Text of the file.

        Raises
        ------
        UsageError
            For an invalid fit.
        """
        from ..physics.simulator import dumps, write_simulator

        if self.trouble:
            raise UsageError(f"this fit is not a plausible vehicle: {self.trouble}")
        if path is not None:
            write_simulator(self.model, Path(path), self.result.remarks)
        return dumps(self.model, self.result.remarks)

    def __repr__(self) -> str:
        priors = sum(p.prior_share == 1.0 for p in self.result.parameters.values())
        return (f"VehicleModel of {self.result.n_flights} flights, {len(self.result.parameters)} parameters"
                + f", {priors} of them priors" * bool(priors)
                + (f"; NO RESULT: {self.trouble}" if self.trouble else ""))

    def _repr_html_(self) -> str:
        from markupsafe import escape

        return f"<p>{escape(repr(self))}</p>{self.parameters_.to_html()}"


@speaks_python
def fit(flights: Flight | Iterable[Flight], terms: Sequence[str] | Mapping[str, Mapping[str, Any]] | None = None,
        mass_kg: float = 0.04085, seed: int = 0, priors: str | os.PathLike[str] | None = None,
        arm_m: float | None = None) -> VehicleModel:
    """Fit the vehicle that flew.

    Thrust level, drag, moment of the air, trim and inertia are read from whole flights. What flights cannot identify
    keeps its prior and is marked (``parameters_.prior_share``). ``nanobench sysid --train`` exports the same vehicle.

    Velocity that is not recorded follows from the positions. Without any battery voltage, a constant one is assumed,
    and ``result.assumed`` lists it.

    Parameters
    ----------
    flights : Flight or iterable of Flight
        As ``nb.load`` gives them.
    terms : list of str, optional
        Names of effects to fit to predictions half a second ahead instead (``nanobench sysid --list``). Such a model
        predicts, and need not be a physical vehicle.
    mass_kg : float
        From a scale; flights show only ratios to it.
    seed : int
        Of everything random. The same seed gives the same result.
    priors : path, optional
        A file in the form of ``identification/vehicle/priors.toml`` with numbers of your own vehicle. The shipped
        priors are scaled by mass and arm for vehicles of another size.
    arm_m : float, optional
        From the centre to each motor; default 0.046.

    Returns
    -------
    VehicleModel
        Parameters in SI units with intervals; it predicts, linearises, and writes a simulator.toml.

    Raises
    ------
    InputError
        Where no flight can be used, with the reason.

    Examples
    --------
    >>> import nanobench_tools as nb
    >>> model = nb.fit(nb.simulate(3, seed=1, seconds=12.0))
    >>> bool(0.5 < model.parameters_.loc["thrust_scale.s", "value"] < 1.5)
    True
    """
    from identification.greybox.ablation_study import fit_item, predictor_of
    from identification.greybox.fit import GreyBox
    from identification.greybox.ladder import BALANCED, VEHICLE
    from identification.vehicle.vehicle_priors import PriorsFile

    from ..auditing.selection import distinct
    from ..physics import Model
    from ..physics.vehicle import sized

    vehicle = sized(mass_kg, arm_m)
    cases = _cases(distinct(some(flights))[0])
    if terms is not None:
        if priors is not None:
            raise UsageError("priors belong to the vehicle; a fit of chosen terms takes none")
        greybox = GreyBox(terms, vehicle=vehicle, seed=seed).fit(cases)
        return VehicleModel(greybox.model_, greybox.result_, lambda: cast("Predictor", greybox.predictor_))
    given = None if priors is None else PriorsFile.read(priors)
    found = fit_item(cases, VEHICLE, seed, vehicle, given)
    return VehicleModel(Model(vehicle, found.simulator), found.result,
                        lambda: cast("Predictor", predictor_of(fit_item(cases, BALANCED, seed, vehicle))))


def _cases(flights: Sequence[Flight]) -> list[Case]:
    """Clean spans of ``flights``; InputError with the reason of the first where none can be used."""
    from ..auditing.recording_audit import audit
    from ..auditing.verb_needs import can
    from ..protocols.completed import completed
    from ..protocols.task1 import training_cases

    whole = completed(flights)
    audits = {flight.name: audit(flight) for flight in flights}
    cases = training_cases(whole, audits)
    if not cases:
        why = can(flights[0], audits[flights[0].name])["sysid"] or "less than half a second of clean flight"
        raise InputError(flights[0].provenance.path, why, f"none of {len(flights)} flights can be used"
                         if len(flights) > 1 else "nb.audit(flight) shows the faults")
    return cases


def _predicted(flight: Flight, predictor: Predictor) -> FlightPrediction:
    from ..protocols.windows import cut_windows, start_times

    case = _cases([flight])[0]
    cut = cut_windows(case.flight, case.spans, "onboard", predictor.information == "past")
    if cut is None:
        raise UsageError(f"{flight.name}: no half second of clean flight to predict; nb.audit(flight) shows why")
    windows, came = cut
    return FlightPrediction(flight.name, predictor.name, start_times(case.flight, case.spans),
                            predictor.predict(windows), came)
