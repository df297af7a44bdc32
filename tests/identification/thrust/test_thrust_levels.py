"""Levels of flights: the weight that was carried, the first seconds, intervals that know of sessions."""

from dataclasses import replace

import numpy as np
import pytest

from identification.thrust.balanced import balance
from identification.thrust.error_rows import FileError
from identification.thrust.error_tables import basis_words, pair_with_firmware
from identification.thrust.firmware import PLUS
from identification.thrust.flight_fit import FlightModel, fit_flights, models
from identification.thrust.flight_levels import FIRST_S, later, level_rows, trust, weight_row
from identification.thrust.flight_rows import LIFT_S, Flown, fly
from identification.thrust.maps import MAPS
from identification.thrust.prediction_intervals import half_width, in_turn, refit_spread, sessions, widened
from identification.thrust.thrust_model import ThrustModel
from identification.thrust.thrust_study import Study, bootstrap, folds_of, held_out
from nanobench_tools.flight import Flight, Provenance, Span, make_stream
from nanobench_tools.units import GRAVITY_M_S2

MASS, KAPPA, OFFSET, DROP = 0.04, 0.0045, 0.7, 1.5


def hovering(seed: int, strength: float = 1.0, epoch_s: float = 0.0, n: int = 500) -> Flown:
    """A flight that carries its weight with propellers of a ``strength`` nobody logged."""
    rng = np.random.default_rng(seed)
    volts = np.linspace(3.9, 3.3, n) + 0.1 * rng.normal()
    hover = (np.sqrt(GRAVITY_M_S2 * MASS / (4.0 * KAPPA * strength)) - OFFSET) / (volts + DROP)
    wave = 0.05 * np.sin(np.arange(n) / 20.0 * rng.uniform(1.0, 3.0) + rng.uniform(0.0, 6.0))
    u = hover[:, None] + wave[:, None] + 0.003 * rng.normal(size=(n, 4))
    force = strength * (KAPPA * (OFFSET + u * (volts[:, None] + DROP)) ** 2).sum(axis=1) / MASS
    count = np.arange(1, n + 1)[:, None]
    lift = np.hstack([np.cumsum(np.column_stack([u, volts]), axis=0) / count, np.minimum(count / 20.0, LIFT_S)])
    return Flown(f"h{seed}", f"h{seed}.csv", f"h{seed}", 0.05, np.arange(n) / 20.0, u, volts,
                 force + 0.03 * rng.normal(size=n), np.zeros(n), np.zeros(n), np.full(n, 6.0), np.zeros((n, 3)), lift,
                 True, epoch_s)


def study_of(name: str, flights: list[Flown]) -> Study:
    """A study of one candidate."""
    candidate = models(MASS)[name]
    held = held_out(candidate, folds_of(flights), None)
    return Study(tuple(flights), {name: candidate}, {name: fit_flights(candidate, flights)}, {name: held}, name,
                 {name: half_width(held.errors, len(flights))}, {}, len(flights))


def rms(missed: np.ndarray) -> float:
    return float(np.sqrt(np.mean(missed**2)))


def test_a_vehicle_that_flies_carries_its_weight():
    """Weak propellers on a flight of their own are seen from its inputs, without an accelerometer."""
    flights = [hovering(s, strength) for s, strength in enumerate(np.linspace(0.97, 1.03, 6))]
    fits = {b: fit_flights(FlightModel(MAPS["switched_motor"], False, MASS, b), flights) for b in (False, True)}
    new = hovering(90, 0.9)
    assert fits[True].trouble == ""
    assert fits[True].values["s"] == pytest.approx(DROP, abs=0.4)
    plain, balanced = (rms(fits[b].predict(new) - new.force) for b in (False, True))
    assert plain > 0.8
    assert balanced < 0.4 * plain  # the first seconds cost most of it
    assert rms((fits[True].predict(new) - new.force)[200:]) < 0.22 * plain


def test_the_balance_looks_at_inputs_of_the_past_alone():
    flight = hovering(1)
    fit = fit_flights(models(MASS)["switched_motor_balanced"], [hovering(s) for s in range(3)])
    before = fit.predict(flight)
    assert np.array_equal(fit.predict(replace(flight, force=np.zeros(len(flight)))), before)
    changed = replace(flight, u=np.where(np.arange(len(flight))[:, None] < 300, flight.u, 0.4))
    assert np.array_equal(fit.predict(changed)[:300], before[:300])


def test_no_time_in_the_air_is_no_balance():
    assert balance(np.array([20.0]), np.array([0.0])) == 1.0
    assert balance(np.array([2.0 * GRAVITY_M_S2]), np.array([1e9])) == pytest.approx(0.5)


def test_memory_of_what_carried_starts_in_the_air_and_forgets():
    t = np.arange(0.0, 30.0, 0.01)
    u = np.where(t < 2.0, 0.2, np.where(t < 15.0, 0.7, 0.8)) + 0.01 * np.sin(7.0 * t)
    made = {"motor": make_stream("motor", t, np.stack([u] * 4, 1), ("m1", "m2", "m3", "m4")),
            "battery": make_stream("battery", t, np.full((len(t), 1), 3.7), ("vbat",)),
            "imu": make_stream("imu", t, np.full((len(t), 1), 9.8), ("acc_z",))}
    rows = fly(Flight("m", made, {}, Provenance("m.csv", "0", "test")), (Span(2.0, 28.0),))
    at = {s: int(np.argmin(np.abs(rows.time_s - s))) for s in (4.0, 14.0, 25.0)}
    assert rows.lift[at[4.0], 0] == pytest.approx(0.7, abs=0.01)
    assert rows.lift[at[4.0], 5] == pytest.approx(LIFT_S * (1.0 - np.exp(-1.5 / LIFT_S)), abs=0.05)
    assert rows.lift[at[14.0], :5] == pytest.approx([0.7] * 4 + [3.7], abs=0.01)
    assert rows.lift[at[25.0], 0] == pytest.approx(0.8 - 0.1 * np.exp(-10.0 / LIFT_S), abs=0.01)


def test_export_of_a_balanced_map_hovers_as_the_training_flights_did():
    flights = [hovering(s, strength) for s, strength in enumerate((0.95, 1.0, 0.96, 0.99))]
    model = ThrustModel("switched_motor_balanced", MASS).use(study_of("switched_motor_balanced", flights))
    lift = np.concatenate([model.predict(f.u, f.battery_V[:, None]).sum(axis=1) for f in flights])
    assert lift.mean() == pytest.approx(MASS * GRAVITY_M_S2, rel=0.01)


def test_rows_say_what_they_were_given_and_first_seconds_help():
    levels = np.random.default_rng(0).normal(0.0, 0.3, 10)
    flights = [replace(f, force=f.force + x) for f, x in zip(map(hovering, range(10)), levels, strict=True)]
    found = study_of("switched_motor", flights[:6])
    rows = {r.name: r.row(0) for r in level_rows(found, "switched_motor", flights[6:], "test")}
    after, learnt, bound = rows.values()
    assert learnt.rms_m_s2 < 0.5 * after.rms_m_s2
    assert bound.rms_m_s2 < 0.06
    assert after.n == learnt.n < bound.n
    assert "accelerometer" in learnt.given
    assert "no prediction" in bound.given
    assert len({after.given, learnt.given, bound.given}) == 3
    assert after.given == "inputs and battery now"
    assert len(repr(after)) < 400
    alone = weight_row(flights[6:], "test").row(0)
    assert alone.rms_m_s2 == pytest.approx(rms(np.concatenate([f.force - GRAVITY_M_S2 for f in flights[6:]])))
    assert (alone.given, alone.coverage95) == ("nothing", None)


def test_first_seconds_are_trusted_as_far_as_they_tell():
    t = np.arange(0.0, 20.0, 0.05)
    same = [(np.full(len(t), x), t) for x in (-0.2, 0.1, 0.3)]
    assert trust(same) == pytest.approx(1.0)
    assert trust([(np.where(t < FIRST_S, x, 0.0), t) for x in (-0.2, 0.1)]) == 0.0
    assert later(np.full(len(t), 0.2), t, 1.0) == pytest.approx(np.zeros(int((t >= FIRST_S).sum())), abs=1e-12)


def test_flights_of_one_day_are_one_session():
    hour = 3600.0
    assert sessions([1e9, 1e9 + hour, 1e9 + 20 * hour, 1e9 + 21 * hour]) == 2
    assert sessions([0.0, 0.0, 0.0]) == 3
    missed = [np.full(20, x) for x in (-0.1, 0.1, 0.05, -0.05, 0.02, 0.0, 0.1, -0.1, 0.03, 0.04)]
    assert half_width(missed, 10, groups=3) > 1.5 * half_width(missed, 10)
    assert half_width(missed, 10, groups=10) == half_width(missed, 10)


def test_coverage_of_flights_held_out_in_turn():
    rng = np.random.default_rng(3)
    missed = [0.2 * rng.normal() + 0.1 * rng.normal(size=200) for _ in range(40)]
    assert in_turn(missed, 40) == pytest.approx(0.95, abs=0.03)
    assert in_turn(missed[:2], 2) is None


def test_interval_is_wider_where_refits_disagree():
    """Motors more uneven than in any training flight: the level there is not known."""
    rng = np.random.default_rng(5)
    warm = 6.0 * (1.0 - np.exp(-np.arange(500) / 100.0))
    flights = [replace(hovering(s), trim=np.tile(0.01 * rng.normal(size=3), (500, 1)), heat=warm,
                       climb=0.3 * rng.normal(size=500), across2=rng.uniform(0.0, 2.0, 500)) for s in range(6)]
    near, far = (replace(flights[0], trim=np.full((500, 3), x)) for x in (0.0, 0.1))
    model = models(MASS)["thrust_voltage_in_flight"]
    draws = bootstrap(model, fit_flights(model, flights), flights, 0, 20)
    assert refit_spread(model, draws, far) > 3.0 * refit_spread(model, draws, near)
    assert widened(0.1, model, draws, far) > widened(0.1, model, draws, near) > 0.1
    assert widened(0.1, model, (), far) == 0.1


def test_the_firmwares_cubic_gets_the_scale_of_a_flight_as_other_maps_do():
    """Vehicles whose motors are the cubic times a number of their own: right once the weight they carried is known."""
    cubic = np.polynomial.Polynomial(PLUS.c)

    def flown(seed: int, strength: float) -> Flown:
        flight = hovering(seed)
        needed = GRAVITY_M_S2 * MASS / (4.0 * strength)
        hover = float(next(r.real for r in (cubic - needed).roots() if abs(r.imag) < 1e-9 and r.real > 0.0))
        held = np.full(4, hover) / flight.battery_V[:, None]
        u = held + 0.03 * np.sin(np.arange(len(held)) / 7.0)[:, None]
        force = strength * cubic(u * flight.battery_V[:, None]).sum(axis=1) / MASS
        lift = np.column_stack([held, flight.battery_V, np.full(len(held), 1e3)])
        return replace(flight, u=u, force=force, lift=lift)

    new = flown(9, 1.2)
    candidates = models(MASS)
    train = [flown(s, strength) for s, strength in enumerate((0.95, 1.0, 1.05))]
    missed = {name: rms(fit_flights(candidates[name], train).predict(new) - new.force)
              for name in ("firmware_2_1_plus", "scaled_2_1_plus", "scaled_2_1_plus_balanced")}
    assert missed["firmware_2_1_plus"] > 1.0
    assert missed["scaled_2_1_plus"] > 1.0  # the scale of other flights is not that of this one
    assert missed["scaled_2_1_plus_balanced"] < 0.2 * missed["scaled_2_1_plus"]


def test_against_the_firmware_as_published_and_scaled_alike():
    """Hand-worked: file a is won against both, file b against the published curves alone."""
    def entry(file: str, model: str, rms_m_s2: float) -> FileError:
        return FileError(file, model, "test", None, rms_m_s2, 0.0, 100)

    entries = [entry(f, m, v) for f, best, scaled in (("a", 0.1, 0.2), ("b", 0.3, 0.2))
               for m, v in (("switched_motor_balanced", best), ("firmware_2_1_plus", 0.6), ("firmware_legacy", 1.3),
                            ("scaled_2_1_plus", 0.05), ("scaled_2_1_plus_balanced", scaled),
                            ("scaled_legacy_balanced", 0.9))]
    found = {p.file: p for p in pair_with_firmware(entries, "switched_motor_balanced")}
    assert [(p.firmware, p.firmware_scaled, p.beaten, p.scaled_beaten) for p in found.values()] == [
        (0.6, 0.2, True, True), (0.6, 0.2, True, False)]
    plain = pair_with_firmware([replace(e, model=e.model.replace("switched_motor_balanced", "dc_motor"))
                                for e in entries], "dc_motor")
    assert [p.firmware_scaled for p in plain] == [0.05, 0.05]


def test_rows_say_how_many_series_of_their_propeller_trained():
    assert basis_words([1, 1, 0]) == ("2 of 3 series: one other series of their propeller, whose battery and motors "
                                      "need not be theirs; 1 of 3: none")
    assert basis_words([4]) == "1 of 1 series: 4 series of their propeller"
    assert basis_words([]) == ""
