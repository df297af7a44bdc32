"""Causes of a change of the trim: physics of each, probabilities against brute force, false alarms and power."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from identification.mismatch.steady.causes import CAUSES, Body
from identification.mismatch.steady.causes.weight import loads
from identification.mismatch.steady.comparison import Flights, compare, normal_flights
from identification.mismatch.steady.known import LOADS, Known
from identification.mismatch.steady.periodic import Swing, frequencies
from identification.mismatch.steady.trim import Trim
from identification.mismatch.steady.trim_page import write_steady_page
from identification.mismatch.steady.trim_simulator import believed_by, corrected, simulator_of
from identification.mismatch.steady.weigh import normal_of, quantiles, weigh
from nanobench_tools.errors import InputError
from nanobench_tools.physics import Model

MOTORS = np.array([[1, -1], [-1, -1], [-1, 1], [1, 1]]) * 0.0325
BODY = Body(MOTORS, 0.034)
PWM = ("pwm.m1",) * 4
BASE = np.log([0.080, 0.070, 0.085, 0.075])


def a_trim(name: str, change=(0.0, 0.0, 0.0, 0.0), level=(0.0, 0.0), push=(np.nan, 0.0), rng=None, sd=0.02,
           known_lift=True) -> Trim:
    def noise(k: int, size: float) -> np.ndarray:
        return np.zeros(k) if rng is None else size * rng.standard_normal(k)

    own = {"gains": np.full(4, 0.003), "level": np.full(2, 0.01), "push": np.full(2, 0.01)}
    return Trim(name, BASE + np.asarray(change) + noise(4, sd), np.asarray(level) + noise(2, sd),
                np.asarray(push) + noise(2, sd), own, known_lift, 3.6, 15.0, 0.5)


def some(n: int, seed: int, change=(0.0, 0.0, 0.0, 0.0), together=0.02, **kwargs) -> list[Trim]:
    """Flights of one day: they share how that day differs."""
    rng = np.random.default_rng(seed)
    day = together * rng.standard_normal(4)
    return [a_trim(f"f{k}", np.asarray(change) + day, rng=rng, sd=0.004, **kwargs) for k in range(n)]


def normals(n: int = 5, seed: int = 0) -> list[Trim]:
    rng = np.random.default_rng(seed)
    return [a_trim(f"n{k}", rng=rng) for k in range(n)]


def loss(motor: int, share: float) -> np.ndarray:
    return -np.log1p(-share) * np.eye(4)[motor - 1]


def load(mass_g: float, x_mm: float, y_mm: float) -> np.ndarray:
    """Change of the ln thrust from four balances, solved: force, moments about x and y, no moment about z."""
    weight = BODY.mass_kg * 9.81
    balance = np.stack([np.ones(4), MOTORS[:, 1], MOTORS[:, 0], np.array([-1.0, 1.0, -1.0, 1.0])])
    added = mass_g / 1e3 * 9.81
    asked = np.linalg.solve(balance, [weight + added, added * y_mm / 1e3, added * x_mm / 1e3, 0.0])
    return np.log(asked / (weight / 4.0))


def test_a_weight_balances_force_and_moments():
    sizes, gains = loads(BODY)
    values = {s.name: s.values for s in sizes}
    possible = np.flatnonzero(gains.min(axis=1) > -1.0)[:50]
    for k in possible:
        assert gains[k] == pytest.approx(load(values["mass"][k], values["x"][k], values["y"][k]), abs=1e-9)


def test_probabilities_are_those_of_brute_force():
    usual = normals()
    normal = normal_of(usual)
    trims = some(3, 1, loss(3, 0.15))
    found = weigh(trims, normal, BODY)
    sizes = np.linspace(0.0, 0.5, 4001)[:, None]
    away = found.delta["gains"] + np.log1p(-sizes) * np.eye(4)[2]
    density = stats.multivariate_t.pdf(away, shape=found.sd["gains"] ** 2 * np.eye(4), df=normal.freedom["gains"])
    nothing = stats.multivariate_t.pdf(found.delta["gains"], shape=found.sd["gains"] ** 2 * np.eye(4),
                                       df=normal.freedom["gains"])
    mine = next(i for i, h in enumerate(found.hypotheses) if h is not None and h.cause == "propeller"
                and h.motors == (3,))
    ratio = np.exp(found.log_likelihood[mine] - found.log_likelihood[-1])
    assert ratio == pytest.approx(density.mean() / nothing, rel=0.02)
    assert found.probability.sum() == pytest.approx(1.0)
    assert sum(c.prior for c in CAUSES.values()) < 1.0


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 3), st.floats(0.0, 0.3))
def test_turning_the_vehicle_turns_the_motors(turns: int, share: float):
    """A quarter turn is a renumbering: causes keep their probabilities."""
    roll = np.roll
    usual = [Trim(t.name, roll(t.gains - BASE, turns), t.level, t.push, t.sd, True, 3.6, 15.0, 0.5) for t in normals()]
    asked = [Trim("a", roll(loss(2, share), turns), np.zeros(2), np.array([np.nan, 0.0]), usual[0].sd, True, 3.6, 15.0,
                  0.5)]
    there = weigh(asked, normal_of(usual), BODY).by_cause()
    plain = [Trim(t.name, t.gains - BASE, t.level, t.push, t.sd, True, 3.6, 15.0, 0.5) for t in normals()]
    here = weigh([Trim("a", loss(2, share), np.zeros(2), np.array([np.nan, 0.0]), usual[0].sd, True, 3.6, 15.0, 0.5)],
                 normal_of(plain), BODY).by_cause()
    for cause, chance in here.items():
        assert there[cause] == pytest.approx(chance, abs=0.03)


@pytest.mark.parametrize("motor", [1, 3])
def test_a_damaged_propeller_is_named_with_its_motor_and_size(motor: int):
    flights = normal_flights(normals(), BODY)
    verdict = compare(some(3, motor, loss(motor, 0.2)), flights, BODY)
    (finding,) = verdict["findings"]
    assert (verdict["outcome"], finding["cause"], finding["motors"]) == ("named", "propeller", [motor])
    size = finding["parameters"][f"loss_m{motor}"]
    assert size["ci95"][0] < 20.0 < size["ci95"][1]
    assert finding["term"] == "motor_imbalance"
    assert {r["cause"] for r in finding["ruled_out"]} >= {"none", "weight", "vehicle"}
    assert verdict["improvement"]["trim"]["after"] < verdict["improvement"]["trim"]["before"]
    assert f"motor {motor}" in verdict["paragraph"]
    assert "Ruled out" in verdict["paragraph"]


def test_a_weight_is_named_with_its_place_and_grams():
    flights = normal_flights(normals(8), BODY)
    verdict = compare(some(3, 2, load(5.0, -25.0, 25.0)), flights, BODY)
    (finding,) = verdict["findings"]
    assert finding["causes"] == ["weight", "slung"]  # a load that does not swing is both
    assert finding["motors"] == [3]
    sizes = finding["parameters"]
    assert sizes["mass"]["value"] == pytest.approx(5.0, abs=2.0)
    assert sizes["x"]["value"] == pytest.approx(-25.0, abs=15.0)
    assert sizes["y"]["value"] == pytest.approx(25.0, abs=15.0)


def test_what_acts_alike_is_named_together():
    verdict = compare(some(3, 3, np.full(4, 0.15)), normal_flights(normals(), BODY), BODY)
    (finding,) = verdict["findings"]
    assert finding["cause"] is None
    assert {"mass", "battery"} <= set(finding["causes"]) <= {"mass", "battery", "weight"}
    assert "cannot distinguish" in verdict["paragraph"]


def neighbours(share_1, share_2):
    """Change of the ln thrust asked of motors 1 and 2, that lost shares of theirs."""
    return loss(1, share_1) + loss(2, share_2)


def test_neighbours_that_lost_alike_and_a_load_between_them_are_named_together():
    """Two blades cut alike ask of the motors what a weight on that side does: one trim does not tell."""
    verdict = compare(some(3, 5, neighbours(0.13, 0.13)), normal_flights(normals(8), BODY), BODY)
    (finding,) = verdict["findings"]
    assert finding["cause"] is None
    assert {"propeller", "weight"} <= set(finding["causes"])
    members = {m["cause"]: m for m in finding["members"]}
    assert members["propeller"]["motors"] == [1, 2]
    low, high = members["propeller"]["dose"]["loss_m1"]["ci95"]
    assert low < 13.0 < high
    assert sum(m["posterior"] for m in finding["members"]) == pytest.approx(finding["confidence"], abs=0.02)
    assert "--nothing-added" in finding["settle_with"]
    assert [c["posterior"] for c in verdict["causes"]] == sorted((c["posterior"] for c in verdict["causes"]),
                                                                 reverse=True)


def test_what_the_user_knows_settles_it():
    told = replace(BODY, absent=LOADS)
    verdict = compare(some(3, 3, neighbours(0.13, 0.13)), normal_flights(normals(8), told), told)
    (finding,) = verdict["findings"]
    assert (finding["cause"], finding["motors"]) == ("propeller", [1, 2])
    assert not {"weight", "slung", "mass"} & {c["cause"] for c in verdict["causes"]}


def test_several_motors_that_changed_may_be_two_propellers_and_a_third_motor():
    """Two cuts, and a third motor that is another one since: no single cause, but a class that holds the two cuts. With
    one vehicle for sure, the cuts are left."""
    change = loss(1, 0.23) + loss(2, 0.18) + loss(3, 0.10)
    verdict = compare(some(3, 5, change), normal_flights(normals(3), BODY), BODY)
    (finding,) = verdict["findings"]
    assert {"vehicle", "propeller"} <= set(finding["causes"])
    assert sum(m["posterior"] for m in finding["members"]) == pytest.approx(finding["confidence"], abs=0.02)
    assert next(m["motors"] for m in finding["members"] if m["cause"] == "propeller") == [1, 2]
    assert "Several motors" in finding["sentence"] or "several motors" in finding["sentence"]
    assert "--same-vehicle" in finding["settle_with"]
    told = replace(BODY, absent=Known(same_vehicle=True).absent)
    (finding,) = compare(some(3, 5, change), normal_flights(normals(3), told), told)["findings"]
    assert "propeller" in finding["causes"]
    assert "vehicle" not in finding["causes"]


def test_a_load_turns_nothing_about_z():
    """Lift and pitch of a weight, and a yaw balance that no load changes."""
    verdict = compare(some(3, 2, load(5.0, -25.0, 25.0) + 0.1 * np.array([-1.0, 1.0, -1.0, 1.0])),
                      normal_flights(normals(8), BODY), BODY)
    assert not {"weight", "slung"} & {c for f in verdict["findings"] for c in f["causes"]}


def test_normal_flights_of_the_same_day_show_less():
    """Three quiet normal flights: the spread from day to day is believed, unless they are of the day."""
    quiet = some(3, 1, together=0.0)
    power = {day: compare(some(3, 5), normal_flights(quiet, BODY, Known(same_day=day)), BODY)["power"]["propeller"]
             for day in (False, True)}
    assert power[True]["minimum_detectable"] < power[False]["minimum_detectable"]


@pytest.mark.slow
def test_another_vehicle_and_wind():
    flights = normal_flights(normals(), BODY)
    other = compare(some(3, 4, (0.1, -0.2, 0.15, -0.1), level=(0.3, -0.2)), flights, BODY)
    assert other["findings"][0]["cause"] == "vehicle"
    assert other["findings"][0]["parameters"] == {}
    blown = compare(some(3, 5, push=(np.nan, 0.8)), flights, BODY)
    assert blown["findings"][0]["cause"] == "wind"


@pytest.mark.slow
def test_false_alarms_and_power_in_many_draws():
    """SYNTHETIC: 20 sets of flights each with days of 2 %; nothing, and a fifth of one motor's thrust."""
    rng = np.random.default_rng(7)
    false = named = covered = 0
    for k in range(20):
        normal = normal_of(normals(5, seed=100 + k))
        motor = int(rng.integers(1, 5))
        nothing = weigh(some(3, 1000 + k), normal, BODY).by_cause()
        false += max(p for cause, p in nothing.items() if cause != "none") >= 0.9
        found = weigh(some(3, 2000 + k, loss(motor, 0.2)), normal, BODY)
        named += found.of("propeller") >= 0.9
        h, weights = next((h, w) for h, w in zip(found.hypotheses, found.weights, strict=True)
                          if h is not None and h.cause == "propeller" and h.motors == (motor,))
        _, low, high = quantiles(h.sizes[0].values, weights)
        covered += low < 20.0 < high
    assert false == 0
    assert named >= 18
    assert covered >= 17


def test_shares_alone_tell_a_propeller_but_no_mass():
    usual = [Trim(t.name, t.gains + k, t.level, t.push, t.sd, False, np.nan, 15.0, 0.5)
             for k, t in zip((0.0, 0.2, -0.1, 0.3, 0.1), normals(), strict=True)]
    flights = normal_flights(usual, BODY)
    verdict = compare(some(3, 1, loss(4, 0.25), known_lift=False), flights, BODY)
    assert verdict["findings"][0]["motors"] == [4]
    heavier = compare(some(3, 2, np.full(4, 0.2), known_lift=False), flights, BODY)
    assert heavier["outcome"] == "none"
    assert "only the shares" in heavier["paragraph"]


def test_too_little_names_nothing():
    flights = normal_flights(normals(), BODY)
    alone = compare(some(1, 1, loss(2, 0.3)), flights, BODY)
    assert alone["outcome"] == "insufficient"
    assert not alone["findings"]
    empty = compare([], flights, BODY, left_out={"a": "never left the ground"})
    assert empty["outcome"] == "insufficient"
    assert "never left the ground" in empty["paragraph"]
    with pytest.raises(InputError, match="2 are needed"):
        normal_flights(normals(1), BODY)


def test_a_flight_of_another_folder_is_left_out_and_said():
    flights = normal_flights(normals(), BODY)
    mixed = [*some(3, 1), a_trim("stranger", (0.0, 0.3, 0.0, 0.3))]
    verdict = compare(mixed, flights, BODY)
    assert verdict["outcome"] == "none"
    assert "stranger is left out" in verdict["paragraph"]
    odd = normal_flights([*normals(), a_trim("odd", (0.3, 0.0, 0.0, 0.0))], BODY)
    assert set(odd.odd) == {"odd"}
    assert odd.normal.n == 5


def test_a_log_of_other_variables_is_left_out_and_said():
    flights = normal_flights(normals(), BODY)
    usual = normal_flights([replace(t, commands=PWM) for t in normals()], BODY)
    good = [replace(t, commands=PWM) for t in some(3, 1)]
    other = replace(a_trim("other", np.full(4, 0.3)), commands=("motor.m1",) * 4)
    assert compare([*good, other], flights, BODY)["outcome"] == "insufficient"
    verdict = compare([*good, other], usual, BODY)
    assert verdict["outcome"] == "none"
    assert "other is left out: its motor commands are motor.m1" in verdict["paragraph"]


def test_quantiles_of_equal_weights_are_those_of_the_draws():
    values = np.random.default_rng(1).standard_normal(4001)
    assert quantiles(values, np.ones(4001) / 4001) == pytest.approx(np.quantile(values, [0.5, 0.025, 0.975]), abs=0.01)


def test_page_of_a_comparison_holds_what_it_draws(tmp_path):
    flights = normal_flights(normals(), BODY)
    named = compare(some(3, 1, loss(3, 0.2)), flights, BODY)
    empty = compare([], flights, BODY, left_out={"<a>": "never left the ground"})
    write_steady_page({"cut <3>": named, "grounded": empty}, tmp_path / "report.html", True, ["two folders"])
    text = (tmp_path / "report.html").read_text()
    assert text.count("<circle") == 4 * (5 + 3)
    assert "cut &lt;3&gt;" in text
    assert "&lt;a&gt; is left out" not in text
    assert "SYNTHETIC" in text
    assert "http" not in text.replace("http-equiv", "")


def swings(n: int, seed: int, peak: float = 1.0) -> list[Swing]:
    """Flights of two runs each: exponential power, sideways only; a peak at 0.65 Hz."""
    rng = np.random.default_rng(seed)
    shape = 1.0 + (peak - 1.0) * np.exp(-0.5 * ((frequencies() - 0.65) / 0.05) ** 2)
    aside = [shape * rng.gamma(2.0, 0.5, len(shape)) for _ in range(n)]
    unseen, unit = np.full(len(shape), np.nan), np.array([np.nan, 1.0])
    return [Swing(np.stack([unseen, p], axis=1), 2, np.stack([unseen, p, unseen], axis=1), unit, 20.0)
            for p in aside]


@pytest.mark.slow
def test_a_load_that_swings_is_no_taped_weight():
    flights = normal_flights(normals(), BODY)
    usual = swings(5, 1)
    hung = compare(some(3, 2, load(4.0, -20.0, 20.0)), flights, BODY, swings=(swings(3, 2, 30.0), usual))
    (finding,) = hung["findings"]
    assert finding["cause"] == "slung"
    low, high = finding["parameters"]["length"]["ci95"]
    assert low < 9.81 * (1.0 + 4.0 / 34.0) / (2.0 * np.pi * 0.65) ** 2 < high
    light = compare(some(3, 3), flights, BODY, swings=(swings(3, 4, 30.0), usual))
    assert light["outcome"] == "unknown"
    assert light["unknown"]["where"]["kind"] == "periodic"
    assert "Hz" in light["paragraph"]
    taped = compare(some(3, 2, load(4.0, -20.0, 20.0)), flights, BODY, swings=(swings(3, 5), usual))
    assert all(f["cause"] != "slung" for f in taped["findings"])


def test_a_simulator_hovers_with_the_trim_it_was_made_of():
    usual = normals()
    normal = normal_of(usual)
    simulator = simulator_of(normal, BODY)
    again = believed_by(simulator)
    assert again.mean["gains"] == pytest.approx(normal.mean["gains"], abs=1e-4)
    assert again.mean["level"] == pytest.approx(normal.mean["level"], abs=1e-3)
    verdict = compare(some(3, 1, loss(2, 0.25)), Flights(again, (), {}), BODY)
    (finding,) = verdict["findings"]
    assert (finding["cause"], finding["motors"]) == ("propeller", [2])
    damaged = believed_by(corrected(simulator, finding))
    size = finding["parameters"]["loss_m2"]["value"] / 100.0
    assert damaged.mean["gains"] - again.mean["gains"] == pytest.approx(loss(2, size), abs=1e-3)
    alike = believed_by(Model(simulator.vehicle, {k: v for k, v in simulator.as_dict().items()
                                                  if k in ("thrust_voltage", "yaw_torque")}))
    assert alike.sd["gains"] > 0.1
    assert np.isnan(alike.mean["level"]).all()


def test_a_corrected_simulator_carries_the_weight():
    simulator = simulator_of(normal_of(normals()), BODY)
    weight = {"causes": ["weight"], "parameters": {"mass": {"value": 4.0}, "x": {"value": -20.0}, "y": {"value": 20.0}}}
    before, after = believed_by(simulator), believed_by(corrected(simulator, weight))
    assert after.mean["gains"] - before.mean["gains"] == pytest.approx(load(4.0, -20.0, 20.0), abs=1e-3)
