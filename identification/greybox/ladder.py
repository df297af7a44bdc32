"""The models of the ablation: one effect more on every rung."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from nanobench_tools.physics import Vehicle
from nanobench_tools.physics.model import typical
from nanobench_tools.physics.vocabulary import added
from nanobench_tools.settings import setting

Terms = Mapping[str, Mapping[str, Any]]

HEAVY = 0.5
"""kg m^2, the largest inertia a vehicle may have: no motor turns it, the rate is held."""

RATE_HELD: Terms = {"inertia": {"inertia_kg_m2": (HEAVY,) * 3}}
THRUST_PWM: Terms = setting("greybox.ladder.thrust_pwm")
THRUST: Terms = setting("greybox.ladder.thrust")
LAG: Terms = setting("greybox.ladder.lag")
DRAG: Terms = setting("greybox.ladder.drag")
TURNING: Terms = setting("greybox.ladder.turning")
AIR_MOMENT: Terms = setting("greybox.ladder.air_moment")


@dataclass(frozen=True)
class Rung:
    """One row of the ablation.

    - name: of the row; sentence: its addition.
    - terms: with the start values of a fit.
    - adapt: the per-window values (``none``, ``inputs`` before the start, ``past``: all streams before the start).
    - hold: terms that are not fitted.
    - physical: parameters are those of the vehicle (``identification.vehicle``), not those that predict best."""

    name: str
    sentence: str
    terms: Terms = field(default_factory=dict)
    adapt: str = "none"
    hold: tuple[str, ...] = ()
    physical: bool = False

    @property
    def information(self) -> str:
        return "past" if self.adapt == "past" else "state"


FULL: Terms = {**THRUST, **LAG, **DRAG, **TURNING, **AIR_MOMENT}
"""inflow, and a prior for drag from the accelerometer, were tried too: whole training flights held out in turn, they
lower no error."""

VEHICLE = Rung("fit_vehicle", "a physical vehicle: parameters from whole flights, priors where these cannot identify "
                              "them. Thrust, trim, tilt and start follow from the inputs of the half second before",
               adapt="inputs", physical=True)
BALANCED = Rung("fit_balanced", "full; thrust, trim, tilt and start follow from the inputs of the half second before",
                FULL, "inputs")

LADDER = (
    Rung("fit_thrust_pwm", "thrust from PWM alone, rate held", {**THRUST_PWM, **RATE_HELD}),
    Rung("fit_thrust_voltage", "thrust from PWM and voltage, rate held", {**THRUST, **RATE_HELD}),
    Rung("fit_lag", "+ motor lag and delay", {**THRUST, **LAG, **RATE_HELD}),
    Rung("fit_drag", "+ drag", {**THRUST, **LAG, **DRAG, **RATE_HELD}),
    Rung("fit_torque", "+ moments of the motors, damping", {**THRUST, **LAG, **DRAG, **TURNING}),
    Rung("fit_full", "+ moment of lateral air", FULL),
    BALANCED,
    Rung("fit_observed", "full; thrust, trim, tilt and start learnt from all streams of the two seconds before", FULL,
         "past"),
    VEHICLE,
    *(Rung(f"fit_{name}", f"full + {name}", {**FULL, name: typical(term, Vehicle().rotors)})
      for name, term in added().items() if not term.is_map and name not in FULL),
)
"""The last ones: terms of other packages, each added to the full model."""
