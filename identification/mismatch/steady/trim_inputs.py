"""Inputs for a comparison of trims, from recordings: one item a flight, so that an interrupted run can continue."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.units import GRAVITY_M_S2

from .causes import Body
from .known import NOTHING, Known
from .periodic import Swing, swing_in
from .reconstruct import states_of
from .trim import Trim, runs_of, trim_of


def trim_item(flight: Flight) -> dict[str, Any]:
    """{trim, swing} of a flight, or {why} with the reason for having neither."""
    verdict = audit(flight)
    try:
        trim = trim_of(flight, verdict)
    except InputError as error:
        return {"why": f"{error.found}"}
    states = states_of(flight)
    runs = runs_of(flight, verdict, flight["motor"]["m1", "m2", "m3", "m4"], states.time_s)
    return {"trim": trim.to_json(), "swing": swing_in(states, runs).to_json()}


def renamed(value: Mapping[str, Any], name: str) -> dict[str, Any]:
    """A value of ``trim_item`` under another name."""
    return {**value, "trim": {**value["trim"], "name": name}} if "trim" in value else dict(value)


def trims_in(values: Mapping[str, Mapping[str, Any]]) -> tuple[list[Trim], list[Swing], dict[str, str]]:
    """(trims, swings, {name: reason for having neither}) of values of ``trim_item`` by the flights' names."""
    trims = [Trim.from_json({**v["trim"], "name": name}) for name, v in values.items() if "trim" in v]
    swings = [Swing.from_json(v["swing"]) for v in values.values() if "swing" in v]
    return trims, swings, {name: v["why"] for name, v in values.items() if "why" in v}


def body_of(normal: Sequence[Trim], mass_kg: float | None = None, simulator: Model | None = None,
            known: Known = NOTHING) -> Body:
    """The vehicle of the simulator, if there is one; otherwise a Crazyflie. Its mass is then the one that its normal
    flights carried by the firmware's thrust curve."""
    vehicle = simulator.vehicle if simulator is not None else Vehicle()
    motors = np.array(vehicle.motor_positions_m, float)
    if mass_kg is None and simulator is not None:
        mass_kg = vehicle.mass_kg
    if mass_kg is not None:
        return Body(motors, mass_kg, absent=known.absent)
    lifts = [np.exp(t.gains).sum() / GRAVITY_M_S2 for t in normal if t.known_lift]
    mass = float(np.mean(lifts)) if lifts else Vehicle().mass_kg
    return Body(motors, mass, absent=known.absent)
