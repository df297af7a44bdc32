"""Slow balances on practice flights whose vehicle is known."""

import numpy as np
import pytest

from identification.balance import balance
from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.errors import InputError
from nanobench_tools.physics import Vehicle
from nanobench_tools.practice.vehicle_parameters import VEHICLE
from nanobench_tools.protocols.task1 import training_cases

NAMES = ("slow figure_eight", "fast figure_eight", "fast trefoil")


@pytest.fixture(scope="module")
def cases(crowd):
    flights = [crowd.flight(name) for name in NAMES]
    return training_cases(flights, {f.name: audit(f) for f in flights})


def test_the_vehicle_is_found_again(cases, crowd):
    found = balance(cases)
    values = found.model.parameters
    mass = Vehicle().mass_kg
    assert found.flights == len(NAMES)
    assert min(found.explained) > 0.5
    assert values["thrust_scale.s"] == pytest.approx(VEHICLE["thrust_scale"].value, rel=0.05)
    assert values["drag_linear.d[0]"] / mass == pytest.approx(VEHICLE["drag_lateral_1_s"].value, rel=0.1)
    assert values["drag_torque.c"] == pytest.approx(VEHICLE["drag_torque_N_s"].value, rel=0.3)
    assert found.draws.shape[1] == len(found.model.names)
    spread = found.draws[:, found.model.index("thrust_scale.s")].std()
    assert 0.0 < spread < 0.03
    assert np.isfinite(found.draws).all()


def test_too_little_is_refused(cases):
    from dataclasses import replace

    with pytest.raises(InputError, match="to identify a plant from"):
        balance([replace(cases[0], spans=cases[0].spans[:0])])
