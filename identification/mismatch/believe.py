"""Identify a simulator's parameters from recordings that it produced, so that any black box that flies can be
diagnosed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from nanobench_tools.errors import InputError
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.physics.model import find_term
from nanobench_tools.settings import number, setting

from .commanded import unit_of
from .fitting import Slopes, fit, slopes
from .levels import with_levels
from .moments import Moments, moments_of
from .naming import free_of, name_effects
from .recordings import Recordings
from .size import grown
from .space import reduced, space_around
from .wrench import Wrench

START: dict[str, dict[str, Any]] = setting("mismatch.believe.start")
START_ROTORS = 4
LAG = "motor_lag"
"""Fitted once thrusts are about right. Before that, its first step may end at zero, where it has no slope and stays."""
HEIGHT = "com_offset.r_m[2]"
"""Not fitted together with drag_torque: under linear drag both give the same moment, and the fit has no unique
minimum."""
LEAST_S = number("mismatch.believe.least_s")


def start_of(vehicle: Vehicle) -> dict[str, dict[str, Any]]:
    """START on a vehicle of another size and number of rotors: as much thrust and drag for its weight."""
    found: dict[str, dict[str, Any]] = {}
    for name, values in START.items():
        term = find_term(name)
        share = START_ROTORS / vehicle.rotors if term.is_map else 1.0
        sizes = {key: grown(vehicle, term.parameter(key)) * share for key in values}
        found[name] = {key: tuple(sizes[key] * x for x in value) if isinstance(value, tuple) else value * sizes[key]
                       for key, value in values.items()}
    return {**found, "motor_imbalance": {"g": (1.0,) * vehicle.rotors}}


def beliefs(recordings: Recordings, vehicle: Vehicle | None = None, progress: Callable[[str], None] | None = None,
            place: str = "--simulated") -> Model:
    """The model that reproduces recordings of a simulator: START fitted, and further terms as long as they explain.

    vehicle: its known properties (mass, arms); free flight shows only thrust over mass. InputError when the recordings
    are too short.
    """
    fitted, moments = _identified(recordings, vehicle, place)
    named = name_effects(moments, space_around(fitted), fitted, progress)
    return reduced(named.fit.model, named.space.believed, tuple(h.term for h in named.accepted))


def _identified(recordings: Recordings, vehicle: Vehicle | None, place: str) -> tuple[Model, Moments]:
    """START fitted, and the moments it was fitted to."""
    if recordings.flights and all(unit_of(flight) for flight in recordings.flights):
        raise InputError(place, "its recordings hold a collective command and no motor commands",
                         "give --simulator FILE")
    _check_length(recordings, place)
    wrench = Wrench(recordings.tracks)
    vehicle = vehicle or Vehicle()
    model = Model(vehicle, start_of(vehicle))
    level = tuple(term for term in START if term != LAG)
    for free in (level, level, tuple(START), tuple(START)):
        model, moments = _fitted(wrench, model, tuple(START), free)
    return model, moments


def _check_length(recordings: Recordings, place: str) -> None:
    """InputError for too little flight, with the first reason why a recording was left out."""
    if recordings.judged_s >= LEAST_S:
        return
    why = next((f" ({name}: {reason})" for name, reason in recordings.left_out.items()), "")
    raise InputError(place, f"{recordings.judged_s:.0f} s of clean flight{why}", f"give at least {LEAST_S:.0f} s")


def fit_along(recordings: Recordings, model: Model, terms: Sequence[str]) -> Model:
    """``model`` with the parameters of some ``terms`` fitted along the states of recordings, added where it lacks them;
    InputError when the recordings are too short."""
    _check_length(recordings, "recordings")
    return _fitted(Wrench(recordings.tracks), model, tuple(terms))[0]


def _fitted(wrench: Wrench, model: Model, terms: tuple[str, ...],
            free: tuple[str, ...] | None = None) -> tuple[Model, Moments]:
    """``terms`` stay in the model, ``free`` of them are fitted: all by default."""
    space = space_around(model)
    asked = np.concatenate([space.free(t) for t in space.terms])
    moments = with_levels(moments_of(wrench, wrench.residual(space.model), slopes(wrench, space.model, asked)[0],
                                     [space.model.names[i] for i in asked]), space)
    asked = free_of(space, terms if free is None else free)
    asked = asked[[space.model.names[i] != HEIGHT or "drag_torque" not in terms for i in asked]]
    core = fit(Slopes(moments), space.model, asked)
    return reduced(core.model, space.believed, terms), moments
