"""The engine against the simulator that says the same: written apart, they must agree where nothing is concealed."""

from dataclasses import replace
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest

from identification.prove.airframe import Airframe, draw_airframe
from identification.prove.case_kinds import CaseSpec, FlightSpec, Hidden, Nuisance
from identification.prove.effects import EFFECTS, FOREIGN, KNOWN
from identification.prove.engine import Engine, vehicles_of
from identification.prove.make import PLACES, effects_of, simulators, true_airframes, truth_of
from nanobench_tools import so3
from nanobench_tools.physics.rollout import rollout
from nanobench_tools.practice.flying import STEP_S, fly
from nanobench_tools.practice.onboard_crowd import OnboardFleet
from nanobench_tools.practice.references import path_spec
from nanobench_tools.practice.timeline import Events

pytestmark = pytest.mark.slow

WINDOW = 250
CALM = Nuisance(0.0, 0.0)
PATH = replace(path_spec("trefoil", "medium", altitude_m=0.45, z_amplitude_m=0.2, scale_m=0.6, duration_s=1.6),
               turn=(0.9, 2.0))
EVENTS = Events(0.3, 3.8, 5.5, 5.6, 5.6)
STARTS = np.arange(850, 2450, 150)
"""Steps in the air at which windows begin."""


def watched(engine):
    """The engine, keeping states, what was sent, and the battery at every step."""
    class Watched(engine):
        seen: ClassVar[list] = []

        def step(self, dt_s):
            self.seen.append((self.state.copy(), self.motor.copy(), self.battery_V.copy()))
            super().step(dt_s)

    return Watched


def spec_of(effects, airframe, seed=8):
    """One flight with these effects known to the simulator."""
    rng = np.random.default_rng(seed)
    known = tuple(Hidden(name, "large", EFFECTS[name].draw("large", rng, airframe)) for name in effects)
    return CaseSpec("case", "null", seed, 0, airframe, (FlightSpec(PATH, "pid", 0.9),), known=known, nuisance=CALM)


def flown(specs, engine=Engine, *more):
    """All steps of several cases of one flight, flown together."""
    kind = watched(engine)
    airframes = [a for s in specs for a in true_airframes(s)]
    rngs = [np.random.default_rng([1, i]) for i in range(len(specs))]
    vehicles = vehicles_of(airframes, rngs, charge_at_start=[0.9] * len(specs), disturbance_m_s2=[0.0] * len(specs),
                           thrust_noise=[0.0] * len(specs))
    fly(OnboardFleet(["pid"] * len(specs)), [s.flights[0].path for s in specs], vehicles, 3,
        indices=[PLACES * i for i in range(len(specs))], events=[EVENTS] * len(specs),
        physics=lambda *given: kind(*given, airframes, effects_of(specs), *more), fresh=True)
    states, motor, battery = (np.array(x) for x in zip(*kind.seen, strict=True))
    return states, motor, battery


@pytest.fixture(scope="module")
def crowd():
    """Every effect on an airframe of its own, and one without any."""
    names = [(), *[(n,) for n in KNOWN if n not in ("thrust_voltage", "frame_tilt")],
             ("wind", "drag_quadratic", "inflow"), *[(n,) for n in FOREIGN if n != "tether"]]
    specs = [spec_of(n, draw_airframe(np.random.default_rng(i))) for i, n in enumerate(names)]
    return names, specs, flown(specs)


def test_every_effect_is_what_its_term_says(crowd):
    """Half a second from true states with the inputs of every 2 ms: 5 micrometres, 0.3 mrad/s."""
    names, specs, (states, motor, battery) = crowd
    for i, spec in enumerate(specs):
        if names[i] and names[i][0] in FOREIGN:
            continue
        model = simulators(spec, 3.8)[0].on(rate_hz=500.0)
        if "thrust_scale" in names[i]:
            assert model.parameters["thrust_scale.s"] != 1.0
        rows = STARTS[:, None] + np.arange(WINDOW)
        before = STARTS[:, None] - np.arange(20, 0, -1)
        inputs = motor[:, :, i]
        found = rollout(model, states[STARTS][:, :, i], inputs[rows], battery[rows, i],
                        (inputs[before], battery[before, i]), row_hz=1.0 / STEP_S)
        true = states[STARTS[:, None] + np.arange(WINDOW), :, i]
        up = (true[..., 2] > 0.1).all(axis=1)
        assert up.sum() >= 6
        found, true = found[up], true[up]
        label = ", ".join(names[i]) or "nothing"
        assert np.abs(found[:, :-1, :3] - true[..., :3]).max() < 5e-6, label
        assert np.abs(found[:, :-1, 3:6] - true[..., 3:6]).max() < 5e-5, label
        assert so3.geodesic_angle(found[:, :-1, 6:10], true[..., 6:10]).max() < 1e-4, label
        assert np.abs(found[:, :-1, 10:13] - true[..., 10:13]).max() < 2e-3, label


def test_effects_do_something(crowd):
    """Half a second without knowing of it misses by more than the agreement with knowing."""
    names, specs, (states, motor, battery) = crowd
    rows = STARTS[:, None] + np.arange(WINDOW)
    for i, spec in enumerate(specs[1:], start=1):
        blind = replace(spec, known=(), concealed=spec.known)
        model = simulators(blind, 3.8)[0].on(rate_hz=500.0)
        found = rollout(model, states[STARTS][:, :, i], motor[rows, :, i], battery[rows, i], row_hz=1.0 / STEP_S)
        off = np.abs(found[:, -1, :13] - states[STARTS + WINDOW][:, :13, i]).max()
        assert off > 2e-3, names[i]


def test_tether_and_jet_by_hand():
    """A tether pulls by stiffness times stretch, a cable hangs by its length, a jet is full at its place."""
    def push(name, at, **p):
        effect = EFFECTS[name].acting([(EFFECTS[name].arrays(p, Airframe()), 1)])
        return effect.push(SimpleNamespace(position=np.array(at)[:, None]))[:, 0]

    spring = {"kind": "spring", "N_per_m": 0.1, "anchor_m": [0.3, 0.0, 0.0], "length_m": 0.5}
    np.testing.assert_allclose(push("tether", (0.9, 0.0, 0.8), **spring), -0.05 * np.array([0.6, 0.0, 0.8]))
    np.testing.assert_allclose(push("tether", (0.3, 0.3, 0.0), **spring), 0.0)
    np.testing.assert_allclose(push("tether", (1.0, 2.0, 0.7), kind="cable", N_per_m=0.02), (0.0, 0.0, -0.014))
    jet = {"peak_m_s2": 2.0, "mass_kg": 0.04, "place_m": [0.5, 0.0, 1.0], "width_m": 0.3, "push": [0.0, 1.0, 0.0]}
    np.testing.assert_allclose(push("jet", (0.5, 0.0, 1.0), **jet), (0.0, 0.08, 0.0))
    np.testing.assert_allclose(push("jet", (0.5, 0.3, 1.0), **jet), (0.0, 0.08 * np.exp(-0.5), 0.0))


def test_flights_that_rotorpy_leaves_out_are_in_no_effect():
    from identification.prove.engine_rotorpy import on_rotorpy

    rng, airframe = np.random.default_rng(4), draw_airframe(np.random.default_rng(2))
    wind = Hidden("wind", "large", EFFECTS["wind"].draw("large", rng, airframe), flights=(2, 3, 4, 5))
    spec = replace(spec_of((), airframe), kind="change", flights=spec_of((), airframe).flights * 6, concealed=(wind,))
    short = on_rotorpy(spec)
    assert (len(short.flights), short.concealed[0].flights) == (4, (2, 3))
    late = on_rotorpy(replace(spec, concealed=(replace(wind, flights=(5,)),)))
    assert (len(late.flights), late.concealed[0].flights) == (6, (5,))
    simulator, corrected = simulators(short, 3.8)
    assert truth_of(short, simulator, corrected, []).effects[0].flights == ("flight_3", "flight_4")


def test_rotorpy_flies_what_the_simulator_says():
    """A tenth of a second with the inputs of every 2 ms: far below the 0.15 rad/s that noise leaves in a recording. The
    rest is RotorPy's lag of the speed, not of the thrust."""
    from identification.prove.engine_rotorpy import RotorPyEngine, on_rotorpy

    specs = [on_rotorpy(spec_of(names, draw_airframe(np.random.default_rng(2)))) for names in ((), ("wind",))]
    airframe = specs[0].airframe
    assert on_rotorpy(spec_of(("inflow",), airframe)) is None
    states, motor, battery = flown(specs, RotorPyEngine, [airframe] * 2)
    rows = STARTS[:, None] + np.arange(51)
    before = STARTS[:, None] - np.arange(200, 0, -1)
    for i, spec in enumerate(specs):
        model = simulators(spec, 3.8)[0].on(rate_hz=500.0)
        start = states[STARTS][:, :, i].copy()
        start[:, 13:] = airframe.k_f_N_s2 * start[:, 13:] ** 2
        found = rollout(model, start, motor[rows, :, i], battery[rows, i], (motor[before, :, i], battery[before, i]),
                        row_hz=1.0 / STEP_S)[:, 50]
        true = states[rows[:, 50], :, i]
        up = states[STARTS, 2, i] > 0.15
        assert up.sum() >= 6
        assert np.abs(found[up, 3:6] - true[up, 3:6]).max() < 2e-3
        assert np.abs(found[up, 10:13] - true[up, 10:13]).max() < 0.03
