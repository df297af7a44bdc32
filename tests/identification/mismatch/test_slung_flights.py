"""SYNTHETIC flights with a load on a string: a pendulum integrated beside a controlled vehicle, found by the trim."""

import dataclasses

import numpy as np
import pytest
from hover_flights import OFF_S, ON_S, hover

from identification.mismatch.steady.comparison import compare, normal_flights
from identification.mismatch.steady.trim_inputs import body_of, trim_item, trims_in
from nanobench_tools.flight import make_stream
from nanobench_tools.physics.pendulum import lengths_m, swing

LENGTH_M, MASS_KG, VEHICLE_KG = 0.63, 0.004, 0.0326


def hung(name, seed, toward_deg=35.0, load_kg=MASS_KG, asked=(0.0, 0.0, 0.0, 0.0)):
    """Holds its place by a position controller with a lag, yaw 0, while the load swings along ``toward_deg``."""
    flight = hover(name, asked, seed=seed)
    t = flight["motor"].time_s
    rng = np.random.default_rng([seed, 1])
    toward = np.exp(1j * np.radians(toward_deg))  # level vectors are complex numbers: x + y i
    flying = (t >= ON_S) & (t <= OFF_S)
    place, speed, lean, gust = 0j, 0j, 0j, 0j
    s, ds = 0.25 * toward * (load_kg > 0.0), 0j
    w2, h = 9.81 / LENGTH_M, 0.001
    path = np.zeros((len(t), 3), complex)
    wander = 0.25 * (np.sin(2.0 * np.pi * 0.2 * t) + 1j * np.sin(2.0 * np.pi * 0.17 * t))
    gusts = 0.02 * rng.standard_normal((int(flying.sum()), 2)) @ [1.0, 1j]
    for k, push in zip(np.flatnonzero(flying).tolist(), gusts.tolist(), strict=True):
        path[k] = place, speed, lean
        gust, goal = 0.95 * gust + push, complex(wander[k])
        for _ in range(10):
            a = 9.81 * lean + load_kg / VEHICLE_KG * w2 * s + gust
            wish = (-3.0 * place - 2.5 * speed + goal) / 9.81
            lean = lean + h * (wish - lean) / 0.08
            ds = ds + h * (-w2 * s - 0.02 * w2**0.5 * ds - a)
            s, speed = s + h * ds, speed + h * a
            place = place + h * speed
    old = flight["estimator"]
    x, y = path.real.T, path.imag.T
    values = np.column_stack([x[0], y[0], old["z"], x[1], y[1], old["vz"]]) + 1e-4 * rng.standard_normal((len(t), 6))
    attitude = np.column_stack([-y[2], x[2], 0.0 * t]) + 5e-4 * rng.standard_normal((len(t), 3))
    return flight.with_streams(estimator=dataclasses.replace(old, values=values),
                               attitude=make_stream("attitude", t, attitude, ("roll", "pitch", "yaw")))


def judged(flights, usual):
    """verdict.json of flights against normal ones."""
    mine, swings, lost = trims_in({f.name: trim_item(f) for f in flights})
    normal, usual_swings, _ = trims_in({f.name: trim_item(f) for f in usual})
    body = body_of(normal, VEHICLE_KG)
    return compare(mine, normal_flights(normal, body), body, left_out=lost, swings=(swings, usual_swings))


@pytest.fixture(scope="module")
def usual():
    return [hung(f"n{k}", k, load_kg=0.0) for k in range(4)]


KNOT = tuple(np.log1p(MASS_KG / VEHICLE_KG * (1.0 + np.array([-1.0, 1.0, 1.0, -1.0]) * 20.0 / 32.5
                                                + np.array([-1.0, -1.0, 1.0, 1.0]) * 10.0 / 32.5)))
"""What the motors are asked for with the load knotted 20 mm behind and 10 mm left of the middle."""


def test_a_load_on_a_string_is_named_with_its_frequency_direction_and_length(usual):
    verdict = judged([hung(f"h{k}", 10 + k, asked=KNOT) for k in range(3)], usual)
    (finding,) = verdict["findings"]
    sizes = finding["parameters"]
    assert finding["cause"] == "slung"
    assert finding["term"] == "slung_load"
    held = np.sqrt(9.81 / LENGTH_M) / (2.0 * np.pi)
    free = held * np.sqrt(1.0 + MASS_KG / VEHICLE_KG)
    low, high = sizes["frequency"]["ci95"]
    assert low < free < high
    assert held - 0.06 < sizes["frequency"]["value"] < free + 0.06
    low, high = sizes["length"]["ci95"]
    assert low < LENGTH_M < high
    low, high = sizes["mass"]["ci95"]
    assert low < 1e3 * MASS_KG < high
    assert verdict["swing"]["found"]["direction_deg"] == pytest.approx(35.0, abs=8.0)
    assert "string" in verdict["paragraph"]


@pytest.mark.parametrize("toward_deg", [-50.0, 80.0])
@pytest.mark.slow
def test_the_direction_has_its_sign(usual, toward_deg):
    found = judged([hung(f"d{k}", 20 + k, toward_deg, asked=KNOT) for k in range(2)], usual)["swing"]["found"]
    assert found["direction_deg"] == pytest.approx(toward_deg, abs=8.0)


@pytest.mark.slow
def test_without_a_load_no_swing_is_found(usual):
    verdict = judged([hung(f"s{k}", 30 + k, load_kg=0.0) for k in range(3)], usual)
    assert verdict["swing"]["found"] is None
    assert verdict["outcome"] == "none"


@pytest.mark.slow
def test_a_swing_without_a_weight_is_unknown_and_periodic(usual):
    verdict = judged([hung(f"u{k}", 40 + k) for k in range(3)], usual)
    assert verdict["outcome"] == "unknown"
    assert "periodic, at" in verdict["unknown"]["hint"]
    assert "Hz, horizontal, along" in verdict["unknown"]["hint"]


def test_the_pendulum_swings_as_the_books_say():
    """Held still it rings at sqrt(g / l); carried at a steady acceleration it hangs back by a l / g and pulls m a."""
    n, h = 4000, 0.005
    start = np.array([[0.1, 0.0], [0.0, 0.0]])
    ring = swing(np.zeros((n, 2)), h, LENGTH_M, MASS_KG, start=start)[:, 0]
    w = np.sqrt(9.81 / LENGTH_M)
    np.testing.assert_allclose(ring, MASS_KG * w**2 * 0.1 * np.cos(w * h * np.arange(n)), atol=1e-9)
    carried = swing(np.full((n, 2), 0.5), h, LENGTH_M, MASS_KG, damping=0.3)
    np.testing.assert_allclose(carried[-1], -MASS_KG * 0.5, rtol=1e-6)
    assert lengths_m(w / (2.0 * np.pi), 0.1) == pytest.approx((LENGTH_M, 1.1 * LENGTH_M), rel=1e-3)
