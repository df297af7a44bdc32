"""What predictive control makes of measurements, clocks and futures that are wrong."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from mpc_flights import World, flight, fresh, resting, with_future

from nanobench_tools import so3
from nanobench_tools.methods import Reference, VehicleState
from nanobench_tools.practice.references import path_spec


def test_a_lost_measurement_is_bridged_by_the_model_and_then_the_vehicle_sinks():
    spec, controller = path_spec("figure_eight", "slow"), fresh("mpc_daqp")

    def outage(t, state):
        gone = 1.2 <= t < 1.7
        return VehicleState(state.position_m * (np.nan if gone else 1.0), *list(vars(state).values())[1:])

    _, worst = flight(controller, spec, 2.5, seen=outage)
    assert worst < 0.02
    assert controller.guard.counts["measurement"] == 50
    assert controller.guard.counts["lost"] == 0
    state, _ = resting()
    state.position_m[:] = np.nan
    for k in range(70):
        command = controller.command(2.5 + 0.01 * k, state, spec.reference(np.zeros(1)))
    assert controller.guard.lost.all()
    assert np.ptp(command) == 0.0


def test_a_pose_that_stands_still_while_the_vehicle_flies_is_not_believed():
    spec, controller = path_spec("figure_eight", "fast"), fresh("mpc_daqp")
    held = {}

    def frozen(t, state):
        if t < 1.2 or t >= 1.6:
            held.update(vars(state))
        return VehicleState(held["position_m"], held["velocity_m_s"], held["quaternion"], state.rate_rad_s,
                            state.battery_V)

    _, worst = flight(controller, spec, 2.5, seen=frozen)
    assert controller.counts["stale"] > 25
    assert worst < 0.12  # 0.4 s at 1 m/s


def test_a_clock_that_stands_or_runs_back_holds_the_command_and_one_that_leaps_starts_anew():
    controller = fresh("mpc_daqp")
    state, reference = resting(r_position_m=np.array([[0.0, 0.0, 0.02]]))
    first = controller.command(5.0, state, reference).copy()
    for t in (5.0, 4.99, 5.0 - 1e-9):
        np.testing.assert_array_equal(controller.command(t, state, reference), first)
    assert controller.counts["time"] == 3
    assert controller.counts["started"] == 1
    assert np.any(controller.command(5.01, state, reference) != first)
    controller.command(9.0, *resting(position_m=np.full((1, 3), 0.2)))
    assert controller.counts["started"] == 2
    np.testing.assert_allclose(controller.observer.state[0, :3], 0.2, atol=1e-3)
    controller.command(np.nan, state, reference)
    assert controller.counts["time"] == 5


def test_a_future_that_is_no_use_is_guessed_and_counted():
    controller = fresh("mpc_daqp")
    spec = path_spec("circle", "slow")

    expected = controller.command(0.0, World(with_future(spec, 0.0)).seen(), with_future(spec, 0.0, ahead=None)).copy()
    controller.reset(1)
    found = controller.command(0.0, World(with_future(spec, 0.0)).seen(),
                               with_future(spec, 0.0, ahead=lambda s: with_future(spec, np.nan).ahead(s)))
    np.testing.assert_array_equal(found, expected)
    assert controller.counts["future"] == 1


@pytest.mark.parametrize(("ahead", "error"), [
    (lambda seconds: {}["bug"], KeyError), (lambda seconds: None, AttributeError)])
def test_a_bug_of_the_future_comes_out(ahead, error):
    spec = path_spec("circle", "slow")
    with pytest.raises(error):
        fresh("mpc_daqp").command(0.0, World(with_future(spec, 0.0)).seen(), with_future(spec, 0.0, ahead=ahead))


def test_a_future_of_another_shape_is_no_future():
    """A present given where the future was asked for would hold the vehicle where it is asked to be now."""
    controller, spec = fresh("mpc_daqp"), path_spec("circle", "slow")
    with pytest.raises(ValueError, match="give the future of the reference"):
        controller.command(0.0, World(with_future(spec, 0.0)).seen(),
                           with_future(spec, 0.0, ahead=lambda _: with_future(spec, 0.0)))


ANYTHING = st.one_of(st.floats(-3.0, 3.0), st.floats(), st.sampled_from([0.0, np.nan, np.inf, -np.inf, 1e300, -1e-300]))


@pytest.mark.parametrize("name", ["mpc_daqp", "nmpc", pytest.param("mpc_osqp", marks=pytest.mark.slow)])
@settings(max_examples=15, deadline=None, suppress_health_check=list(HealthCheck))
@given(values=arrays(float, (4, 2, 29), elements=ANYTHING))
def test_no_input_makes_it_fail(name, values):
    controller = fresh(name, 2)
    for v in values:
        state = VehicleState(v[:, :3], v[:, 3:6], v[:, 6:10], v[:, 10:13], v[:, 13])
        reference = Reference(v[:, 14:17], v[:, 17], v[:, 18:21], v[:, 21:24], v[:, 24:27], v[:, 27])
        command = controller.command(v[0, 28], state, reference)
        assert command.shape == (2, 4)
        assert np.all((command >= 0.0) & (command <= 1.0))
    start = controller._time_s if np.isfinite(controller._time_s) else 0.0
    for k in range(1, 12):
        command = controller.command(start + 0.01 * k, *resting(2))
        assert np.all((command >= 0.0) & (command <= 1.0))
    assert not controller.guard.lost.any()


@pytest.mark.parametrize("name", ["mpc_daqp", "nmpc"])
@settings(max_examples=15, deadline=None, suppress_health_check=list(HealthCheck))
@given(values=arrays(float, (12,), elements=st.floats(-1.0, 1.0)), volt=st.floats(3.0, 4.2))
def test_from_any_start_in_the_room_every_step_has_a_plan_within_limits(name, values, volt):
    controller = fresh(name)
    state, reference = resting(position_m=2.0 * values[None, :3], velocity_m_s=2.0 * values[None, 3:6],
                               quaternion=so3.exp(1.5 * values[None, 6:9]), rate_rad_s=8.0 * values[None, 9:],
                               battery_V=np.full(1, volt))
    for k in range(3):
        command = controller.command(0.01 * k, state, reference)
    assert controller.counts["solver"] == 0
    assert np.all((command >= 0.0) & (command <= 1.0))
