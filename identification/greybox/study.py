"""The ablation as items of the runner: fits that are found again, and predictors made from what they gave."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from nanobench_tools.physics import Vehicle
from nanobench_tools.protocols.task1 import Case

from .fit import GreyBox, nuisances_of
from .ladder import LADDER, Rung
from .predictor import GreyBoxPredictor

SHORT = ("fit_thrust_voltage", "fit_balanced", "fit_observed")
"""The rungs of the main job."""


NOTES = {"none": "",
         "inputs": "simulator.toml holds the mean thrust and trim of the training flights; the row sets both, the "
                   "tilt, and corrects rate and rotors at the start, from the half second of inputs before each window",
         "past": "simulator.toml holds the mean thrust and trim of the training flights; the row learns them, the "
                 "tilt, and corrections of rate and rotors at the start, from the two seconds before each window"}


def rungs(names: Sequence[str] | None = None) -> list[Rung]:
    """The rungs named, or all."""
    return [rung for rung in LADDER if names is None or rung.name in names]


def fit_item(cases: Sequence[Case], rung: Rung, seed: int, mass_kg: float) -> dict[str, Any]:
    """{predictor, result} of one rung fitted to ``cases``, as plain JSON values."""
    vehicle = Vehicle(mass_kg=mass_kg)
    model = GreyBox(rung.terms, vehicle=vehicle, adapt=rung.adapt, name=rung.name, seed=seed,
                    hold=rung.hold).fit(cases)
    made = model.predictor_
    return {"predictor": {"terms": {term: {k: _plain(v) for k, v in values.items()}
                                    for term, values in made.terms.items()},
                          "gains": _plain(made.gains), "scale": _plain(made.scale), "adapt": made.adapt,
                          "mass_kg": mass_kg},
            "simulator": {term: {k: _plain(v) for k, v in values.items()}
                          for term, values in model.model_.as_dict().items()},
            "simulator_note": NOTES[rung.adapt], "result": model.result_.to_json(),
            "summary": model.result_.summary(), "uses": rung.sentence}


def predictor_of(value: Mapping[str, Any]) -> GreyBoxPredictor:
    """The predictor of a ``fit_item``."""
    made, result = value["predictor"], value["result"]
    gains, scale = (None if made[key] is None else np.array(made[key]) for key in ("gains", "scale"))
    terms = {term: {k: tuple(v) if isinstance(v, list) else v for k, v in values.items()}
             for term, values in made["terms"].items()}
    return GreyBoxPredictor(result["name"], terms, Vehicle(mass_kg=made["mass_kg"]), made["adapt"], gains, scale,
                            result["parameters"], () if gains is None else nuisances_of(made["adapt"]))


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    return list(value) if isinstance(value, tuple) else value
