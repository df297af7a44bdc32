"""``nb.motors``: motor lag, rotor speed and thrust from flights with measured rotor speed."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..flight import Flight
from ..steps.motor_fits import fitted_numbers, motors_sentence, study_motors
from .quiet_options import given, some, speaks_python

if TYPE_CHECKING:
    import pandas as pd

    from identification.motors import Study
    from identification.motors.motor_parts import MotorResult


@dataclass(frozen=True, repr=False)
class Motors:
    """Motors of one vehicle, from measured rotor speed.

    Attributes
    ----------
    result : MotorResult
        As in motors.json.
    study : Study
        The fits.
    """

    result: MotorResult
    study: Study

    @property
    def sentence(self) -> str:
        """Time constants, delay, and the map of rotor speed."""
        return motors_sentence(self.result)

    @property
    def table(self) -> pd.DataFrame:
        """One row per number. Columns: value, ci95_low, ci95_high (nan without an interval), unit (SI)."""
        import pandas as pd

        nan = (float("nan"),) * 2
        rows = [(n.name, n.value, *(nan if n.ci95 is None else n.ci95), n.unit) for n in fitted_numbers(self.result)]
        return pd.DataFrame(rows, columns=["name", "value", "ci95_low", "ci95_high", "unit"]).set_index("name")

    def to_toml(self) -> str:
        """The model as a simulator.toml."""
        from identification.motors.motor_study import simulator

        from ..physics.simulator import dumps

        return dumps(simulator(self.study))

    def __repr__(self) -> str:
        return self.sentence

    def _repr_html_(self) -> str:
        found: str = self.table.to_html()
        return found


@speaks_python
def motors(flights: Flight | Iterable[Flight], test: Flight | Iterable[Flight] | None = None,
           mass_kg: float | None = None, seed: int = 0) -> Motors:
    """Identify the motors of one vehicle from flights with rotor speed and PWM, logged at 200 Hz or more.

    Parameters
    ----------
    flights : Flight or iterable of Flight
        As ``nb.load`` gives them.
    test : Flight or iterable of Flight, optional
        Flights that judge; None: whole flights are held out in turn.
    mass_kg : float, optional
        Of the vehicle with battery; without it thrust and inertia are ratios to the mass.
    seed : int
        Of everything random. The same seed gives the same result.

    Returns
    -------
    Motors
        Lag and delay in s, thrust and moments from rotor speed, inertia.

    Raises
    ------
    InputError
        Where the flights contain too little.

    Examples
    --------
    >>> nb.motors(nb.load("logs_with_rotor_speed"), mass_kg=0.037).table  # doctest: +SKIP
    """
    read = some(flights)
    judges = None if test is None else some(test)
    study, result = study_motors(given([*read, *(judges or ())], seed=seed), read, judges, mass_kg)
    return Motors(result, study)
