"""``ThrustModel``: thrust from PWM and voltage with the habits of scikit-learn."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from nanobench_tools.errors import InputError, UsageError
from nanobench_tools.flight import Flight
from nanobench_tools.physics.vehicle import Vehicle
from nanobench_tools.results.fitted_values import Estimate
from nanobench_tools.units import GRAVITY_M_S2

from .flight_fit import EFFECTS, FlightFit, effect_columns, find_delay
from .flight_rows import Flown
from .inverse import Inverse, invert
from .map_export import Exported, casadi_function, export, flight_terms
from .stand_fit import Fit
from .stand_series import Stand
from .thrust_formula import ThrustFormula, formula_of, voltage_varies, written
from .thrust_rows import Rows, cases_of, fit_to_fly, flown_rows, load, sort_out, stand_rows
from .thrust_study import DRAWS, File, Study, errors, study, target

Source = Flight | str | Path


class ThrustModel:
    """Fits every candidate map, keeps the one that predicts whole files it was not fitted to best.

    ``name``: a candidate to use in place of the chosen one; ``mass_kg``: of the vehicle, for flights (free flight
    shows T/m only); ``draws``: refits for the intervals of the parameters; ``seed``: of these. After ``fit``:

    - ``study_``: all candidates; ``best_``: name of the one in use; ``kind_``: ``stand`` or ``flight``;
    - ``parameters_``, ``delay_s_``, ``left_out_`` (reason by name of recording).
    """

    def __init__(self, name: str | None = None, mass_kg: float = Vehicle().mass_kg, draws: int = DRAWS,
                 seed: int = 0) -> None:
        self.name, self.mass_kg, self.draws, self.seed = name, mass_kg, draws, seed

    def fit(self, sources: Iterable[Source]) -> ThrustModel:
        """``sources``: recordings, or paths of files and folders; all stand series or all flights.

        Raises InputError when nothing can be fitted, or no candidate gives a result.
        """
        flights, audits = load(sources)
        stands, flown = sort_out(flights)
        if stands and flown:
            raise UsageError("stand series and flights are fitted apart: give either")
        self.delay_s_ = 0.0
        rows: Rows[Stand] | Rows[Flown]
        if stands:
            rows = stand_rows(stands)
            self.left_out_ = rows.reasons
        else:
            cases, reasons = cases_of(flown, audits)
            cases = fit_to_fly(cases)
            self.delay_s_ = find_delay(cases, self.mass_kg) if cases else 0.0
            rows = flown_rows(cases, self.delay_s_)
            self.left_out_ = reasons | rows.reasons
        if not rows.files:
            name, reason = next(iter(self.left_out_.items()), ("", "no recording given"))
            raise InputError(name or "fit", f"nothing to fit: {reason}")
        return self.use(study(rows.files, self.mass_kg, self.seed, self.draws))

    def use(self, found: Study) -> ThrustModel:
        """Takes over a study that was made elsewhere."""
        self.study_, self.kind_ = found, "flight" if found.flown else "stand"
        if self.name is not None and self.name not in found.fits:
            raise UsageError(f"unknown map {self.name!r}; there are {', '.join(found.fits)}")
        chosen = self.name or found.best
        if chosen is None or not found.fits[chosen].values:
            why = found.fits[chosen].trouble if chosen else "; ".join(
                f"{n}: {f.trouble}" for n, f in found.fits.items() if f.trouble)
            why = why or "none predicts held-out rows better than a constant"
            raise InputError(found.train[0].path, f"no map is a result ({why})", "give more rows or more files")
        self.best_ = chosen
        return self

    @property
    def fit_(self) -> Fit:
        """The map in use, per motor."""
        found = self.study_.fits[self.best_]
        return found.fit if isinstance(found, FlightFit) else found

    @property
    def scale_(self) -> float:
        """Factor on the map for motors as warm and as unequal as in the mean of the training flights, or for the
        weight carried. It is 1 for a stand series."""
        found = self.study_.fits[self.best_]
        if isinstance(found, FlightFit) and found.model.balanced:
            flown = [f for f in self.study_.train if isinstance(f, Flown)]
            return float(np.mean(np.concatenate([f.force for f in flown]))
                         / np.mean(np.concatenate([found.carried(f.u, f.battery_V) for f in flown])))
        if not isinstance(found, FlightFit) or not found.model.effects:
            return 1.0
        values = np.array([found.values[n] if n not in ("k_z", "k_h") else 0.0 for n, _ in EFFECTS])
        acting = np.concatenate([values @ effect_columns(f) for f in self.study_.train if isinstance(f, Flown)])
        return float(1.0 + acting.mean() / GRAVITY_M_S2)

    @property
    def parameters_(self) -> dict[str, Estimate]:
        """Of the map in use, by name."""
        return self.study_.parameters()[self.best_]

    def predict(self, pwm: ArrayLike, voltage: ArrayLike) -> np.ndarray:
        """Thrust [N] of one motor at PWM ratio 0..1 and battery voltage [V], broadcast; hovering, motors warm."""
        u = np.asarray(pwm, float)
        if u.size and (np.nanmax(u) > 1.0 + 1e-9 or np.nanmin(u) < 0.0):
            raise UsageError(f"pwm {np.nanmin(u):g} to {np.nanmax(u):g} is no ratio 0..1; divide counts by 65535")
        return self.scale_ * self.fit_.predict(u, np.asarray(voltage, float))

    @property
    def formula_(self) -> ThrustFormula:
        """The map in use with its numbers, at hover and at full command of a full and an empty battery."""
        volts = np.concatenate([f.voltage for f in self.study_.train])
        varies = voltage_varies(np.concatenate([f.u for f in self.study_.train]), volts)
        return formula_of(written(self.fit_.map, self.fit_.values, self.scale_),
                          self.predict, self.mass_kg, GRAVITY_M_S2, (float(volts.min()), float(volts.max())),
                          varies)

    def inverse(self, thrust_N: np.ndarray, voltage: np.ndarray) -> Inverse:
        """PWM ratio for a thrust [N] of one motor at a battery voltage [V], with the limit the voltage sets."""
        return invert(self.predict, thrust_N, voltage)

    def score(self, sources: Iterable[Source]) -> float:
        """Share of the variance explained (R^2) on recordings of the same kind."""
        files = self._files(sources)
        truth = np.concatenate([target(f) for f in files])
        missed = np.concatenate([errors(self.study_.fits[self.best_], f) for f in files])
        return float(1.0 - np.sum(missed**2) / np.sum((truth - truth.mean()) ** 2))

    def rms(self, sources: Iterable[Source]) -> float:
        """RMS error on recordings of the same kind: N per motor, or m/s^2 of specific force."""
        missed = np.concatenate([errors(self.study_.fits[self.best_], f) for f in self._files(sources)])
        return float(np.sqrt(np.mean(missed**2)))

    def _files(self, sources: Iterable[Source]) -> Sequence[File]:
        flights, audits = load(sources)
        stands, flown = sort_out(flights)
        rows: Rows[Stand] | Rows[Flown]
        rows = (stand_rows(stands) if self.kind_ == "stand"
                else flown_rows(cases_of(flown, audits)[0], self.delay_s_))
        if not rows.files:
            raise InputError("score", f"no {self.kind_} recording that can be scored",
                             "; ".join(f"{n}: {r}" for n, r in rows.reasons.items()))
        return rows.files

    def export(self) -> Exported:
        """Terms for a simulator.toml and constants for the firmware."""
        u = np.concatenate([f.u.ravel() for f in self.study_.train])
        volts = np.concatenate([f.voltage for f in self.study_.train])
        found = self.study_.fits[self.best_]
        more = flight_terms(found.values) if isinstance(found, FlightFit) and found.model.effects else ()
        return export(self.fit_, (float(u.min()), float(u.max())), (float(volts.min()), float(volts.max())),
                      self.scale_, more)

    def casadi(self) -> Any:
        """casadi.Function (u, V) -> T [N] of one motor."""
        return casadi_function(self.fit_, self.scale_)

    def summary(self) -> str:
        """The choice in words: map, held-out error, parameters with intervals, what was in trouble."""
        found, unit = self.study_, "m/s^2" if self.kind_ == "flight" else "N per motor"
        lines = [f"thrust from {len(found.train)} {'flights' if found.flown else 'stand series'}: {self.best_}",
                 f"  {self.fit_.map.equation}",
                 f"  held-out error {found.scores[self.best_].rms:.4g} {unit}, 95 % of a new file within "
                 f"{found.half_width[self.best_]:.3g}"]
        for name, body in self.parameters_.items():
            interval = body.ci95
            lines.append(f"  {name:12s} {body.value:.5g} {body.unit}"
                         + (f"  [{interval[0]:.4g}, {interval[1]:.4g}]" if interval else ""))
        lines += [f"  {name} is no result: {fit.trouble}" for name, fit in found.fits.items() if fit.trouble]
        return "\n".join(lines)
