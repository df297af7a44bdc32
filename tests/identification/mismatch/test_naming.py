"""Effects concealed from a simulator come back under their own name; a right simulator is left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from carried_tracks import MODEL, track_of, wrench_of
from scipy.signal import lfilter

from identification.mismatch.believe import beliefs
from identification.mismatch.decide import decide
from identification.mismatch.diagnosis import _named, judge
from identification.mismatch.fitting import Slopes, fit, slopes
from identification.mismatch.leftover import Structure, _one_step, _period, gusts
from identification.mismatch.memory import fit_memory
from identification.mismatch.moments import moments_of
from identification.mismatch.naming import _Search, rested
from identification.mismatch.proof import Proof, turned_better
from identification.mismatch.recordings import Recordings
from identification.mismatch.space import space_around, with_other_map
from identification.mismatch.tolerance import smallest, two_groups
from identification.mismatch.verdict import Verdict
from identification.mismatch.wrench import Wrench
from nanobench_tools.flight import Flight, Provenance
from nanobench_tools.physics import Model


def decided(wrench: Wrench, simulator: Model):
    space = space_around(simulator)
    moments, named = _named(wrench, space, simulator, lambda text: None)
    recordings = Recordings((), {}, tuple(wrench.tracks), (), {})
    return moments, decide(recordings, moments, space, named)


@pytest.fixture(scope="module")
def right(plain, model):
    """A right simulator: moments and decision."""
    return decided(plain, model)


@pytest.fixture(scope="module")
def too_heavy(plain, model):
    """A simulator that believes in 15 % too much mass."""
    return decided(plain, model.on(mass_kg=0.046))


@pytest.fixture(scope="module")
def uneven(model):
    """Recordings of four flights, the third with 15 % more mass, and what is judged of them."""
    heavy = model.on(mass_kg=0.046)
    tracks = tuple(track_of(heavy if k == 2 else model, 40 + k, k) for k in range(4))
    flights = tuple(Flight(t.name, {}, {}, Provenance(t.name, "", "made")) for t in tracks)
    recordings = Recordings(flights, {}, tracks, (), {})
    return recordings, *judge(recordings, Wrench(tracks), model)


def names_of(decision) -> list[str]:
    return [f.hypothesis.term for f in decision.findings]


def test_a_right_simulator_has_no_mismatch(right):
    _, decision = right
    assert (decision.outcome, decision.findings) == ("none", ())


@pytest.mark.slow
def test_gusts_are_no_noise_but_nothing_with_a_name(model):
    """Pushes that last a second, drawn anew for every flight."""
    def blown(seed):
        air = np.random.default_rng(seed).normal(0.0, 1.0, (40, 3))
        return lambda position, time: np.array([np.interp(time, np.arange(40), a) for a in 0.4 * air.T])

    wrench = Wrench([track_of(model, 10 + k, k, push=blown(k)) for k in range(3)])
    _, decision = decided(wrench, model)
    assert (decision.outcome, decision.findings) == ("unknown", ())


def test_gusts_have_size_and_duration_and_still_air_is_none(plain, right):
    moments, _ = right
    rng = np.random.default_rng(3)
    many = len(plain.force_at)
    air = lfilter([1.0], [1.0, -np.exp(-0.04 / 0.8)], rng.standard_normal((many + 200, 3)), axis=0)[200:]
    air /= air.std(axis=0)
    gust = gusts(moments, 0.3 * air)
    assert (gust.kind, gust.axes) == ("gusts", ("x", "y", "z"))
    assert gust.size_m_s2 == pytest.approx(0.3 * 3**0.5, rel=0.25)  # but for what is fast
    assert 0.5 < float(gust.hint.split("some ")[1].split()[0]) < 1.5
    assert gusts(moments, 0.09 * air) is None
    assert gusts(moments, 0.3 * rng.standard_normal((many, 3))) is None  # fast noise is no air


def test_a_concealed_drag_is_found_again(plain, model):
    _, decision = decided(plain, model.with_term("drag_linear", d=(0.004, 0.004, 0.006)))
    assert names_of(decision) == ["drag_linear"]
    assert decision.fit.model.parameters["drag_linear.d[0]"] == pytest.approx(0.016, rel=0.1)


@pytest.mark.slow
def test_slow_commands_hardly_tell_a_lag_from_a_delay(plain, model):
    """No input faster than 4 Hz: the delay may be named beside the lag, and nothing else."""
    _, decision = decided(plain, model.with_term("motor_lag", tau_up_s=0.005, tau_down_s=0.005))
    finding, = decision.findings
    named = {finding.hypothesis.term, *finding.equivalent}
    assert "motor_lag" in named
    assert named <= {"motor_lag", "command_delay"}


@pytest.mark.slow
def test_a_heavier_vehicle_is_found(too_heavy):
    _, decision = too_heavy
    finding = decision.findings[0]
    assert "mass" in (finding.hypothesis.term, *finding.equivalent)
    assert decision.fit.model.parameters["mass.m"] == pytest.approx(0.04, rel=0.01)


@pytest.mark.slow
def test_gains_of_motors_keep_their_mean_however_much_thrust_is_wrong(too_heavy, model):
    """A vehicle 15 % heavier than believed is no imbalance of motors."""
    space, (moments, _) = space_around(model.on(mass_kg=0.046)), too_heavy
    found = fit(Slopes(moments), space.model, space.free("motor_imbalance"))
    gains = [value for name, value in found.model.parameters.items() if name.startswith("motor_imbalance.g")]
    assert np.mean(gains) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.slow
def test_two_large_effects_at_once_are_both_named(model):
    """Each by itself, fitted to what both do, is no possible vehicle: that must not hide the other."""
    true = model.with_term("com_offset", r_m=(0.0013, -0.0007, 0.0))
    _, decision = decided(wrench_of(true), model.on(mass_kg=0.0465))
    terms = [{f.hypothesis.term, *f.equivalent} for f in decision.findings]
    assert len(terms) == 2
    assert any("mass" in t for t in terms)
    assert any("com_offset" in t for t in terms)


@pytest.mark.slow
def test_wind_is_not_called_drag(model):
    windy = wrench_of(model.with_term("wind", w_m_s=(0.8, -0.5, 0.0)))
    _, decision = decided(windy, model)
    finding, = decision.findings
    assert "wind" in (finding.hypothesis.term, *finding.equivalent)
    assert not {"drag_linear", "drag_rotor", "drag_quadratic"} & {finding.hypothesis.term, *finding.equivalent}


@pytest.mark.slow
def test_a_force_that_swings_is_unknown_and_no_force_of_the_world(model):
    def swinging(position, time):
        return 0.5 * np.sin(2.0 * np.pi * 0.9 * time) * np.array([0.0, 1.0, 0.0])

    _, decision = decided(Wrench([track_of(model, 30 + k, k, push=swinging) for k in range(3)]), model)
    assert decision.findings == ()
    assert decision.outcome == "unknown"
    assert any(s.kind == "period" and "0.9" in s.hint for s in decision.unknown)


@pytest.mark.slow
def test_a_pull_along_the_vertical_alone_has_no_name(model):
    """A cable that is lifted pulls like this; a force across is one of the world."""
    for force, outcome, names in (((0.0, 0.0, -0.25), "unknown", []), ((0.2, 0.0, -0.25), "named", ["force_world"])):
        wrench = Wrench([track_of(model, 60 + k, k, seconds=20.0, push=lambda p, t, f=force: np.array(f))
                         for k in range(3)])
        _, decision = decided(wrench, model)
        assert (decision.outcome, names_of(decision)) == (outcome, names)


@pytest.mark.slow
def test_flights_that_each_have_another_tilt_are_not_named_after_it(model):
    """Markers sit differently in every flight: the scatter is a nuisance, and the drag behind it is found."""
    tilts = ((0.03, -0.02), (-0.01, 0.015), (0.005, 0.04), (-0.04, 0.0), (0.02, -0.035))
    tracks = [track_of(model.with_term("frame_tilt", roll_rad=r, pitch_rad=p), 50 + k, k, seconds=8.0)
              for k, (r, p) in enumerate(tilts)]
    moments, decision = decided(Wrench(tracks), model.with_term("drag_linear", d=(0.004, 0.004, 0.006)))
    assert set(moments.levels.names) == {"frame_tilt.roll_rad", "frame_tilt.pitch_rad"}
    assert names_of(decision) == ["drag_linear"]
    assert decision.fit.model.parameters["drag_linear.d[0]"] == pytest.approx(0.016, rel=0.1)


@pytest.mark.slow
def test_flights_whose_motors_are_each_uneven_are_not_named_after_it(model):
    """Without the level, gains from command to torque, masses and scales make up for a trim of every flight's own."""
    calm = model.with_term("angular_damping", d_r=(4e-4, 4e-4, 4e-4))  # nobody flies these tracks
    gains = 1.0 + 0.03 * np.random.default_rng(2).normal(size=(5, 4))
    flown = [calm.with_term("motor_imbalance", g=tuple(g / g.mean())) for g in gains]
    moments, decision = decided(Wrench([track_of(m, 10 + k, k, 12.0) for k, m in enumerate(flown)]), calm)
    assert names_of(decision) == []
    assert "motor_imbalance.g[0]" in moments.levels.names


@pytest.mark.slow
def test_mass_and_thrust_scale_are_never_named_both(plain, model):
    wrong = Model(replace(model.vehicle, mass_kg=0.7 * model.vehicle.mass_kg), model.as_dict())
    _, decision = decided(plain, wrong.with_term("inertia", inertia_kg_m2=(3e-5, 3e-5, 5e-5)))
    assert len({"mass", "thrust_scale"} & set(names_of(decision))) <= 1


def test_what_gets_worse_by_more_than_anything_improves_is_no_proof():
    def proof(after: float) -> Proof:
        rows = np.ones((2, 3, 4))
        rows[..., 2], rows[..., 0] = 0.7, after
        return Proof(np.ones((2, 3, 4)), rows, ("a", "b"), False, {10: (0.1, 0.4)}, None, (MODEL, MODEL))

    for after, fine in ((1.1, True), (3.0, False)):
        assert proof(after).no_worse == fine
        assert proof(after).better == fine


@pytest.mark.slow
def test_one_flight_with_a_heavier_vehicle_is_singled_out(uneven):
    _, _, decision, _ = uneven
    assert decision.own
    name = next(n for n in decision.fit.own if n.startswith(f"{decision.own[0]}."))
    assert int(np.argmax(np.abs(decision.fit.own[name] - np.median(decision.fit.own[name])))) == 2


@pytest.mark.slow
def test_the_flight_that_differs_is_in_the_verdict(uneven, model):
    recordings, *judged = uneven
    body = Verdict.of(recordings, model, *judged, 0.0).to_json()
    assert body["outcome"] == "named"
    assert any(f["where"]["flights"] == ["flight_3"] for f in body["findings"])


@pytest.mark.slow
def test_beliefs_of_a_simulator_from_its_flights(plain, model):
    found = beliefs(Recordings((), {}, tuple(plain.tracks), (), {}), model.vehicle)
    assert found.parameters["drag_linear.d[0]"] == pytest.approx(0.016, rel=0.05)
    assert found.parameters["motor_lag.tau_up_s"] == pytest.approx(0.04, abs=0.008)
    force, _ = plain.residual(found)
    assert np.sqrt(np.mean(force**2)) < 0.08  # the air alone is 0.04 a axis


def test_slopes_are_derivatives(plain, model):
    """Against central differences of another step."""
    space = space_around(model)
    which = [space.model.index(n) for n in ("drag_linear.d[0]", "com_offset.r_m[1]", "inertia.inertia_kg_m2[0]")]
    force, torque = slopes(plain, space.model, which)
    from identification.mismatch.space import scales

    for column, i in enumerate(which):
        step = 0.01 * scales(space.model)[i]
        up, down = space.model.values.copy(), space.model.values.copy()
        up[i] += step
        down[i] -= step
        above, below = plain.model(space.model, up), plain.model(space.model, down)
        np.testing.assert_allclose(force[..., column], (above[0] - below[0]) / 0.02, atol=1e-3 * np.ptp(force) + 1e-9)
        np.testing.assert_allclose(torque[..., column], (above[1] - below[1]) / 0.02, atol=2e-3 * np.ptp(torque) + 1e-9)


def test_the_other_map_gives_the_same_thrust_at_its_voltage():
    other = with_other_map(MODEL, 3.7)
    u = np.linspace(0.3, 1.0, 8)
    old = np.polyval(MODEL.values_of("thrust_voltage")["c"][::-1], u * 3.7)
    np.testing.assert_allclose(np.polyval(other.values_of("thrust_pwm")["c"][::-1], u), old, rtol=1e-12)


def test_a_term_at_rest_is_the_simulators_own_again():
    home, other = space_around(with_other_map(MODEL, 3.7)), space_around(MODEL)
    moved = other.model.with_parameters({"mass.m": 0.05, "drag_linear.d[0]": 0.03})
    here = rested(moved, ["drag_linear"], other, home)
    assert here.parameters == {**other.model.parameters, "mass.m": 0.05}
    back = rested(moved, ["thrust_voltage"], other, home)  # swapped: at rest the simulator's map from PWM is back
    assert "thrust_voltage" not in back
    assert back.parameters == {**home.model.parameters, "mass.m": 0.05, "drag_linear.d[0]": 0.03}


def test_a_burst_counts_as_long_as_it_lasts():
    assert Structure("bursts", 0.5, 100.0, ("z",), "", share=0.01).rms_m_s2 == pytest.approx(0.05)
    assert Structure("place", 0.5, 100.0, ("z",), "").rms_m_s2 == 0.5


@pytest.mark.slow
def test_a_strong_swing_is_found_though_the_residual_remembers_it(model):
    """A regression on the samples before predicts a swing: whitened by it, its peak is lost among the others."""
    plain = wrench_of(model, seconds=20.0)
    moments = moments_of(plain, plain.residual(model), np.zeros((len(plain.force_at), 3, 0)), [])
    rng, at = np.random.default_rng(9), plain.force_at
    time, flight = plain.of("time_s", at), plain.flight[at]
    air = lfilter([1.0], [1.0, -0.9], 0.02 * rng.standard_normal((len(at), 3)), axis=0)
    force = air + np.outer(0.9 * np.sin(2.0 * np.pi * 1.45 * time + flight), [0.65, 0.75, 0.1])
    runs = moments.channels[0].memory.runs
    channels = [replace(c, memory=fit_memory(x, np.zeros((len(at), 0)), runs, 3))
                for c, x in zip(moments.channels[:3], force.T, strict=True)]
    remembered = [c.memory.whiten(x) for c, x in zip(channels, force.T, strict=True)]
    height = [float(np.abs(np.exp(-2j * np.pi * 1.45 * time) @ w) ** 2 / (w @ w)) for w in
              (remembered[1], _one_step(force[:, 1]))]
    assert height[0] < 0.5 * height[1]
    found = _period(replace(moments, channels=[*channels, *moments.channels[3:]]), force, flight)
    assert found.kind == "period"
    assert "1.4" in found.hint
    assert found.size_m_s2 == pytest.approx(0.75 * 0.9 / 2**0.5, rel=0.2)  # short tracks: coarse frequencies


def test_a_long_delay_is_tried_however_little_it_promises(right, model):
    """Its rank to first order is no word on what acts far from linearly."""
    moments, _ = right
    space = space_around(model)
    search = _Search(moments, space, model)
    search._promise = lambda term, *_: -1e9 if term == "command_delay" else 0.0
    assert "command_delay" in [h.term for h in search.tried()]


@pytest.mark.slow
def test_a_curve_that_is_no_more_than_a_level_gives_way_to_it(plain, model):
    """Accepted while another effect was hidden, it is a scale once that one is named too."""
    simulator = model.with_term("motor_lag", tau_up_s=0.0, tau_down_s=0.0).with_term(
        "thrust_voltage", c=tuple(0.9 * c for c in MODEL.values_of("thrust_voltage")["c"]))
    moments, _ = decided(plain, simulator)
    search = _Search(moments, space_around(simulator), simulator)
    for term in ("thrust_voltage", "motor_lag"):
        search.accept(next(h for h in search.tried() if h.term == term), [])
    search._levelled()
    assert sorted(search.names)[0] == "motor_lag"
    assert set(search.names) & {"thrust_scale", "mass"}
    assert "thrust_voltage" not in search.names


def test_damping_is_told_better_by_setpoints_than_by_shaking(plain, right, model):
    """The smallest damping that is named; about z nothing is asked for."""
    moments, _ = right
    space = space_around(model)
    without = [smallest(f"angular_damping.d_r[{k}]", space.model, moments) for k in range(3)]
    asked = Wrench([replace(t, asked_rad_s2=np.ones((len(t), 2))) for t in plain.tracks])
    with_ = [smallest(f"angular_damping.d_r[{k}]", space.model, replace(moments, wrench=asked)) for k in range(3)]
    assert with_ == pytest.approx([0.4 * without[0], 0.4 * without[1], without[2]])


def test_flights_that_scatter_are_not_two_groups():
    """Real flights scatter by some per cent; a payload that was put on parts them."""
    scattered = np.array([0.81, -0.44, 0.69, 0.29, 0.03, -0.90])
    assert not two_groups(scattered)
    assert two_groups(np.where(np.arange(6) < 3, 0.0, 15.0) + scattered)
    assert two_groups(np.array([0.0, 0.1, 5.0]))  # three cannot scatter
    rng = np.random.default_rng(1)
    assert np.mean([two_groups(rng.normal(size=8)) for _ in range(400)]) < 0.1


def test_a_name_that_turns_is_kept_for_turning_alone():
    """(flights, H, 4) errors: position says nothing, and what gets worse by more than the rest improves is no gain."""
    errors = np.full((3, 3, 4), 0.1)
    pushed, turned, mixed = errors.copy(), errors.copy(), errors.copy()
    pushed[..., :2] *= 0.5
    turned[:, 2, 3] *= 0.9
    mixed[:, 1, 3] *= 0.9
    mixed[:, 2, 2] *= 1.3
    assert not turned_better(errors, pushed)
    assert turned_better(errors, turned)
    assert not turned_better(errors, mixed)
