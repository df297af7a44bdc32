"""Vehicles of other sizes, with or without battery rows, flown by a model: what flights show is right, what they do not
show is a scaled prior whose interval holds the truth."""

from dataclasses import replace

import numpy as np
import pytest
from many_rotors import flights_of, model_of

from identification.greybox.fit_windows import cut, gather
from identification.greybox.flyability import flies
from identification.vehicle.vehicle_fit import fit_vehicle
from nanobench_tools.errors import InputError
from nanobench_tools.flight import Span
from nanobench_tools.physics.vehicle import sized
from nanobench_tools.protocols.completed import completed
from nanobench_tools.protocols.task1 import Case


@pytest.mark.parametrize(("mass_kg", "arm_m", "with_battery"), [
    pytest.param(0.03, 0.046, True, marks=pytest.mark.slow), pytest.param(0.067, 0.05, False, marks=pytest.mark.slow),
    (0.5, 0.15, False)])
@pytest.mark.slow
def test_a_vehicle_of_another_size_hovers_and_its_priors_hold_the_truth(mass_kg, arm_m, with_battery):
    true = model_of(4, mass_kg, arm_m)
    flights = flights_of(true, 3)
    cases = [Case(flight, [Span(0.5, 14.5)], ("all",))
             for flight in completed(flights if with_battery else [f.without_streams("battery") for f in flights])]
    found = fit_vehicle(cases, sized(mass_kg, arm_m))
    flown = flies(found.model, gather(cut(cases)))
    assert flown.stable
    assert flown.hover_ratio == pytest.approx(1.0, abs=0.02)
    assert found.model.parameters["drag_linear.d[0]"] == pytest.approx(0.4 * mass_kg, rel=0.1)
    for axis in (0, 1):
        inertia = found.parameters[f"inertia.inertia_kg_m2[{axis}]"]
        assert inertia.ci95[0] < true.vehicle.inertia_kg_m2[axis] < inertia.ci95[1]
    assert any("scaled from" in note for note in found.notes) == (mass_kg > 0.05)


@pytest.mark.slow
def test_an_unsure_lag_leaves_the_inertia_to_its_prior(monkeypatch):
    """Of a vehicle of another size the lag may be off by half, and the inertia from its flights with it."""
    from identification.vehicle import vehicle_fit

    cases = [Case(flight, [Span(0.5, 14.5)], ("all",)) for flight in completed(flights_of(model_of(4, 0.5, 0.15), 3))]
    unsure = fit_vehicle(cases, sized(0.5, 0.15)).parameters["inertia.inertia_kg_m2[0]"]
    monkeypatch.setattr(vehicle_fit, "_lag_share", lambda known, measured: 0.0)
    sure = fit_vehicle(cases, sized(0.5, 0.15)).parameters["inertia.inertia_kg_m2[0]"]
    assert unsure.prior_share > 2.0 * sure.prior_share
    assert np.diff(unsure.ci95) > np.diff(sure.ci95)


def test_motors_of_another_kind_are_said():
    cases = [Case(flight, [Span(0.5, 14.5)], ("all",)) for flight in completed(flights_of(model_of(4, 0.03, 0.046), 3))]
    strong = [replace(case, flight=replace(case.flight, streams={
        **case.flight.streams, "motor": replace(case.flight["motor"], values=0.6 * case.flight["motor"].values)}))
        for case in cases]
    with pytest.raises(InputError, match=r"another vehicle or mass than .* times the thrust per mass"):
        fit_vehicle([*cases[:2], *strong[2:]], sized(0.03))
    other = fit_vehicle(strong, sized(0.03))
    assert any("lag and yaw moment" in note for note in other.notes)
    assert other.parameters["motor_lag.tau_down_s"].ci95[0] < 0.03
    assert other.parameters["motor_lag.tau_down_s"].ci95[1] > 0.12
    assert not any("lag and yaw moment" in note for note in fit_vehicle(cases, sized(0.03)).notes)
