"""The network on top of physics: symmetry, kinematics, and never worse than the physics on flights held out."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from identification.learned.bound import flexible_bound
from identification.learned.correction import corrected, modules, wanted
from identification.learned.features import POSITIONS, position_matrices, seen
from identification.learned.libraries import libraries
from identification.learned.own import SETTINGS, Corrected, Flown, guard, held_out, rising, train_own
from identification.naive import Naive
from nanobench_tools import so3
from nanobench_tools.errors import InputError
from nanobench_tools.methods import Prediction
from nanobench_tools.metrics.prediction import QUANTITIES, window_errors
from nanobench_tools.protocols.windows import cut_windows
from nanobench_tools.units import GRAVITY_M_S2

DT = 0.01


class Sinks:
    """Stands still, but falls with 0.4 m/s^2: an error that the state does not show and any correction finds."""

    name, information = "sinks", "state"

    def predict(self, windows):
        held = Naive().predict(windows)
        t = DT * np.arange(1, windows.horizon + 1)[None, :, None]
        down = np.array([0.0, 0.0, -0.4])
        return replace(held, velocity_m_s=held.velocity_m_s + t * down, position_m=held.position_m + t**2 / 2 * down
                       + t * windows.velocity_m_s[:, None])


@pytest.fixture(scope="module")
def flown(cases):
    """Every flight's windows and what the falling model says of them."""
    found = []
    for case in cases:
        windows, came = cut_windows(case.flight, case.spans, "onboard")
        found.append(Flown(case.flight.name, windows, came, Sinks().predict(windows)))
    return found


def test_positions_are_rotations_and_mirrors_of_the_same_vehicle():
    matrices = position_matrices("tms")
    assert matrices.shape == (POSITIONS, 7, 7)
    for a in matrices:
        np.testing.assert_allclose(a @ a.T, np.eye(7))
        assert any(np.allclose(a @ matrices[1], b) for b in matrices)
    velocity, force = np.random.default_rng(0).normal(size=(2, 3))
    for kind in position_matrices("tmm"):  # a moment is the cross product of two vectors, however one looks at it
        moved = kind @ np.concatenate([np.cross(velocity, force), velocity, force])
        np.testing.assert_allclose(moved[:3], np.cross(moved[3:6], moved[6:]), atol=1e-12)


def test_features_turn_with_the_vehicle(flown):
    """Yaw of the world changes nothing that the network sees."""
    windows, predicted = flown[0].windows, flown[0].predicted
    turn = so3.from_euler_zyx(0.0, 0.0, 0.7)

    def turned(state, *names):
        return replace(state, **{n: so3.multiply(turn, getattr(state, n)) if n == "quaternion" else so3.rotate(
            turn, getattr(state, n)) for n in names})

    a = seen(windows, predicted)
    b = seen(turned(windows, "position_m", "velocity_m_s", "quaternion"),
             turned(predicted, "position_m", "velocity_m_s", "quaternion"))
    for part in ("context", "steps", "thrust"):
        np.testing.assert_allclose(getattr(a, part), getattr(b, part), atol=1e-9)
    assert a.context.shape[1] == sum(1 if k == "s" else 3 for k in a.kinds[0])
    assert a.steps.shape[2] == sum(1 if k == "s" else 3 for k in a.kinds[1])


def test_kinematics_of_what_the_network_says():
    jnp, eqx = libraries().jnp, libraries().eqx
    net = modules().Correction(5, 13, libraries().jax.random.key(0))
    said = np.array([0.4, -0.2, 0.1, 0.3, 0.0, -0.1])
    net = eqx.tree_at(lambda m: (m.out.weight, m.out.bias), net, (0.0 * net.out.weight, jnp.asarray(said, jnp.float32)))
    h = 50
    up = np.broadcast_to([0.0, 0.0, GRAVITY_M_S2], (1, h, 3))
    errors = np.asarray(net(np.zeros((1, 5)), np.zeros((1, h, 13)), up, np.zeros((1, h, 3)),
                            np.broadcast_to(np.eye(3), (1, h, 3, 3)), DT))[0]
    t = DT * np.arange(1, h + 1)[:, None]
    spin, force = said[:3] * 8.0, said[3:] * 0.5
    np.testing.assert_allclose(errors[:, 9:], t * spin, atol=1e-4)
    np.testing.assert_allclose(errors[:, 6:9], t**2 / 2 * spin, atol=1e-4)
    tilted = np.cross(spin, [0.0, 0.0, GRAVITY_M_S2])
    np.testing.assert_allclose(errors[:, 3:6], t * force + t**3 / 6 * tilted, atol=0.02)
    np.testing.assert_allclose(errors[:, :3], t**2 / 2 * force + t**4 / 24 * tilted, atol=0.004)


def test_wanted_errors_put_the_physics_right(flown):
    after = corrected(flown[0].predicted, wanted(flown[0].predicted, flown[0].came))
    for error in window_errors(after, flown[0].came).values():
        assert error.max() < 1e-9


def test_network_that_talks_nonsense_leaves_the_physics(flown):
    net = modules().Correction(seen(flown[0].windows, flown[0].predicted).context.shape[1], 13,
                               libraries().jax.random.key(1))
    leaves = [100.0 * np.asarray(leaf) for leaf in libraries().jax.tree.leaves(net) if hasattr(leaf, "shape")]
    size = seen(flown[0].windows, flown[0].predicted)
    spread = (np.zeros(size.context.shape[1]), np.ones(size.context.shape[1]), np.zeros(13), np.ones(13))
    held = [Flown(f.name, f.windows, f.came, f.came) for f in flown]  # physics that is right already
    shares, onsets, table = guard([held], [SimpleNamespace(leaves=leaves)], spread, False)
    assert not shares.any()
    own = Corrected("own", Sinks(), (tuple(leaves),), spread, shares, onsets)
    for name in ("position_m", "quaternion"):
        np.testing.assert_array_equal(getattr(own.predict(flown[0].windows), name), getattr(flown[0].predicted, name))
    assert own.parameters["share_position"].value == 0.0
    assert table["position_mae_m"].corrected == table["position_mae_m"].physics
    np.testing.assert_allclose(rising(3.0, 4), 1.0 - np.exp(-np.arange(4) / 3.0))


@pytest.mark.slow
def test_bound_finds_what_a_simulator_leaves_out_and_is_never_above_it(flown):
    quick = replace(SETTINGS, epochs=5, batch=32, share=1.0, learning_rate=2e-2)
    found = flexible_bound(Sinks(), [(f.name, f.windows, f.came) for f in flown], quick)
    assert (found.flights, found.windows) == (3, sum(len(f.windows) for f in flown))
    for name in QUANTITIES:
        for key in ("1", "10", "50", "sum"):
            assert found.flexible[name][key] <= found.simulator[name][key]
    assert found.flexible["velocity_mae_m_s"]["50"] < 0.95 * found.simulator["velocity_mae_m_s"]["50"]
    assert found.share(found.simulator)["velocity_mae_m_s"] == 0.0
    assert found.share(found.flexible)["velocity_mae_m_s"] == pytest.approx(1.0)


def test_one_flight_cannot_be_held_out(flown, cases):
    with pytest.raises(InputError, match="1 flight is left: none can be held out"):
        held_out(cases[:1], lambda sets: [Naive() for _ in sets])
    with pytest.raises(InputError, match="1 to bound a simulator with"):
        flexible_bound(Naive(), [(f.name, f.windows, f.came) for f in flown[:1]])
    with pytest.raises(InputError, match="no window to train a correction on"):
        train_own("own", Naive(), [])


def test_held_out_flights_are_not_in_their_fit(cases):
    fitted = []

    def fits(sets):
        fitted.extend({case.flight.name for case in rest} for rest in sets)
        return [Naive() for _ in sets]

    groups = held_out(cases, fits, groups=3)
    assert [len({f.name for f in group}) for group in groups] == [1, 1, 1]
    for known, group in zip(fitted, groups, strict=True):
        assert not known & {f.name for f in group}
        assert isinstance(group[0].predicted, Prediction)
