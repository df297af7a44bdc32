"""The nominal simulator of a vehicle, fitted to flights that no case uses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from identification.greybox.fit_windows import cases_of
from identification.mismatch.believe import fit_along, start_of
from identification.mismatch.recordings import Recordings
from identification.vehicle.vehicle_fit import fit_vehicle
from nanobench_tools.flight import Flight
from nanobench_tools.physics import Model, Vehicle

from .vehicles import VehicleSource

PASSES = 3
"""Fits along the states, each from the values of the one before."""
K_F = 3.45e-8
"""Where a fit of thrust to rotor speed begins, N s^2; ``thrust_scale`` is fitted and multiplied into it."""
ON_COMMANDS = ("thrust_scale", "drag_linear", "motor_lag")
"""Terms of a vehicle whose collective command is known, and no motor command."""


def fit_nominal(source: VehicleSource, flights: Sequence[Flight], recordings: Recordings) -> Model:
    """The simulator of a vehicle, from its training flights as they were read and as a diagnosis sees them."""
    vehicle = source.vehicle
    if source.fit == "vehicle":
        return fit_vehicle(cases_of(flights), vehicle).model
    start = start_of(vehicle)
    terms: tuple[str, ...]
    if vehicle.input == "thrust":
        terms = ON_COMMANDS
        model = Model(vehicle, {name: start[name] for name in ON_COMMANDS if name in start})
    else:
        start = {n: v for n, v in start.items() if n not in ("thrust_voltage", "motor_lag")}
        terms = ("thrust_scale", *start, "inertia")
        model = Model(vehicle, {"thrust_rpm": {"k_f": K_F}, **start})
    for _ in range(PASSES):
        model = fit_along(recordings, model, terms)
    return _plain(model)


def _plain(model: Model) -> Model:
    """``inertia`` in the vehicle, and ``thrust_scale`` in ``k_f`` where the model has one."""
    terms, vehicle = model.as_dict(), asdict(model.vehicle)
    inertia = terms.pop("inertia", None)
    if inertia is not None:
        vehicle["inertia_kg_m2"] = inertia["inertia_kg_m2"]
    if "thrust_rpm" in terms and "thrust_scale" in terms:
        terms["thrust_rpm"]["k_f"] *= terms.pop("thrust_scale")["s"]
    return Model(Vehicle(**vehicle), terms)


def as_json(model: Model) -> dict[str, Any]:
    """A model as JSON values, exact."""
    return {"vehicle": asdict(model.vehicle), "terms": model.as_dict()}


def from_values(values: Mapping[str, Any]) -> Model:
    """The model of ``as_json``."""
    vehicle = dict(values["vehicle"])
    vehicle["motor_positions_m"] = tuple(tuple(p) for p in vehicle["motor_positions_m"])
    for name in ("inertia_kg_m2", "spin"):
        vehicle[name] = tuple(vehicle[name])
    return Model(Vehicle(**vehicle), values["terms"])
