"""Without motion capture the estimated position and attitude judge the other columns, and each other."""

from dataclasses import replace

import pytest

from nanobench_tools.auditing.faults import axis_swap, frame, sign, unit
from nanobench_tools.signals.context import Context


@pytest.fixture(scope="module")
def own(crowd):
    return crowd.log("fast figure_eight")[0].without_streams("mocap", "attitude_qw", "setpoint")


def _read_as(flight, stream, quantities, change):
    values = flight[stream].values.copy()
    at = [flight[stream].index(q) for q in quantities]
    values[:, at] = change(values[:, at])
    return flight.with_streams(**{stream: replace(flight[stream], values=values)})


def test_a_right_table_is_no_finding(own):
    assert [kind.find(own, Context(own)) for kind in (sign, axis_swap, unit)] == [[], [], []]


@pytest.mark.parametrize("quantity", ["vx", "vz"])
def test_a_negated_velocity(own, quantity):
    bad = _read_as(own, "estimator", [quantity], lambda v: -v)
    (fault,) = sign.find(bad, Context(bad))
    assert fault.columns == (f"est_stateEstimate_{quantity}",)
    assert "position predicts" in fault.evidence


def test_a_negated_axis_of_position_and_velocity_is_the_mirror_image_of_the_tilt(own):
    bad = _read_as(own, "estimator", ["y", "vy"], lambda v: -v)
    (fault,) = sign.find(bad, Context(bad))
    assert fault.columns == ("est_stateEstimate_y",)
    assert "mirror image of its tilt" in fault.evidence


def test_a_position_in_another_unit_than_tilt_and_velocity(own):
    bad = _read_as(own, "estimator", ["x"], lambda v: 0.01 * v)
    (fault,) = unit.find(bad, Context(bad))
    assert fault.columns == ("est_stateEstimate_x",)
    assert fault.size == 0.01


def test_velocities_that_changed_places(own):
    bad = _read_as(own, "estimator", ["vx", "vy"], lambda v: v[:, ::-1])
    (fault,) = axis_swap.find(bad, Context(bad))
    assert fault.columns == ("est_stateEstimate_vx", "est_stateEstimate_vy")


def test_a_negated_height_is_no_turned_frame(own):
    bad = _read_as(own, "estimator", ["z"], lambda v: -v)
    context = Context(bad)
    assert frame.find(bad, context) == []
    (fault,) = sign.find(bad, context)
    assert fault.columns == ("est_stateEstimate_z",)
    assert "against vz of estimator and az" in fault.evidence
