"""Task 1: windows, split, scores of predictors that are known beforehand, and the real rows."""

from dataclasses import replace

import numpy as np
import pytest
from made_flights import cut, dead, made_flight, verdict

from identification.naive import Naive
from identification.published_physics import K_THRUST_N_S2, MASS_KG, OMEGA_FULL_RAD_S, PublishedPhysics
from nanobench_tools import InputError, Windows, so3
from nanobench_tools.flight import Span
from nanobench_tools.metrics.prediction import QUANTITIES
from nanobench_tools.protocols import task1
from nanobench_tools.protocols.published import MeanStd, beside, published
from nanobench_tools.protocols.windows import EVERY, HORIZON, cut_windows, rows_at_100_hz


class Perfect:
    """Knows what came."""

    name, information = "perfect", "state"

    def __init__(self, flight, spans, truth):
        self.true = cut_windows(flight, spans, truth)[1]

    def predict(self, windows):
        return replace(self.true, quaternion=-self.true.quaternion)


def test_windows_hold_the_rows_they_say():
    flight = made_flight()
    spans = (Span(6.0, 8.0), Span(10.0, 10.4))
    windows, true = cut_windows(flight, spans, "mocap")
    assert len(windows) == len(range(0, 201 - HORIZON, EVERY))  # the second span is too short for one
    mocap, motor = flight["mocap"], flight["motor"]
    first = np.searchsorted(mocap.time_s, 6.0 + 3 * 0.1 - 1e-9)
    assert np.array_equal(windows.position_m[3], mocap["px", "py", "pz"][first])
    assert np.array_equal(true.position_m[3], mocap["px", "py", "pz"][first + 1:first + HORIZON + 1])
    assert np.array_equal(windows.motor[3], motor.values[first:first + HORIZON])
    assert np.array_equal(windows.battery_V[3], flight["battery"]["vbat"][first:first + HORIZON])
    assert windows.horizon == HORIZON


@pytest.mark.parametrize("truth", ["onboard", "mocap"])
def test_a_perfect_predictor_scores_exactly_zero(truth):
    flight = made_flight()
    case = task1.Case(flight, (Span(5.0, 15.0),), ("all",))
    value = task1.score(case, Perfect(flight, case.spans, truth), truth)
    assert value.windows > 90
    assert all(np.all(np.array(sums) == 0.0) for sums in value.sums.values())


def test_windows_do_not_cross_a_lost_frame():
    flight = made_flight()
    kept = np.ones(len(flight["mocap"]), bool)
    kept[[700, 900, 901]] = False
    lossy = replace(flight, streams={name: s.rows(kept) for name, s in flight.streams.items()})
    time_s, lengths = rows_at_100_hz(lossy, [Span(5.0, 12.0)])
    assert lengths == [200, 199, 299]
    windows, _ = cut_windows(lossy, [Span(5.0, 12.0)], "mocap")
    assert len(windows) == sum(len(range(0, n - HORIZON, EVERY)) for n in lengths)
    assert len(time_s) == sum(lengths)


def test_other_rates_are_put_on_rows_at_100_hz():
    flight = made_flight()
    faster = flight.with_streams(mocap=flight["mocap"].rows(np.arange(0, len(flight["mocap"]), 2)))
    time_s, lengths = rows_at_100_hz(faster, [Span(7.0, 10.0)])
    assert np.diff(time_s) == pytest.approx(0.01)
    assert lengths == [len(time_s)]
    a, b = (cut_windows(f, [Span(7.0, 10.0)], "mocap")[1] for f in (faster, flight))
    assert np.abs(a.position_m[:20] - b.position_m[:20]).max() < 1e-4


def test_naive_stands_still():
    flight = made_flight(lag_s=0.0)
    case = task1.Case(flight, (Span(7.0, 15.0),), ("all",))
    value = task1.score(case, Naive(), "mocap")
    mean = np.array(value.sums["position_mae_m"]) / value.windows
    chord = 2 * np.sin(0.25 * 0.01 * np.arange(1, HORIZON + 1))  # of a circle of 1 m at 0.5 rad/s
    assert mean == pytest.approx(chord, abs=5e-5)


def windows_of(n=3, motor=1.0, rate=(0.0, 0.0, 0.0), seed=0):
    rng = np.random.default_rng(seed)
    return Windows(rng.normal(size=(n, 3)), rng.normal(size=(n, 3)), so3.exp(0.3 * rng.normal(size=(n, 3))),
                   np.tile(rate, (n, 1)), np.full((n, HORIZON, 4), motor), np.full((n, HORIZON), 3.7))


def test_physics_without_turning_is_a_parabola():
    model, w = PublishedPhysics(), windows_of()
    found = model.predict(w)
    t = 0.01 * np.arange(1, HORIZON + 1)[None, :, None]
    a = so3.rotate(w.quaternion, np.array([0, 0, 1.5 * 9.81]))[:, None] - [0, 0, 9.81]
    np.testing.assert_allclose(found.velocity_m_s, w.velocity_m_s[:, None] + a * t, atol=1e-12)
    np.testing.assert_allclose(found.position_m, w.position_m[:, None] + w.velocity_m_s[:, None] * t + a * t**2 / 2,
                               atol=1e-12)
    assert np.array_equal(found.rate_rad_s, np.zeros((3, HORIZON, 3)))


def test_physics_agrees_with_an_integrator_of_scipy():
    from scipy.integrate import solve_ivp
    from scipy.spatial.transform import Rotation

    rate = np.array([1.0, -2.0, 3.0])
    w = windows_of(1, motor=0.55, rate=rate, seed=4)
    thrust = 4 * K_THRUST_N_S2 * (0.55 * OMEGA_FULL_RAD_S) ** 2 / MASS_KG
    assert thrust < 1.5 * 9.81  # below the limit
    start = Rotation.from_quat(w.quaternion[0])

    def rhs(t, x):
        up = (start * Rotation.from_rotvec(rate * t)).apply([0, 0, 1])
        return np.concatenate([x[3:], thrust * up - [0, 0, 9.81]])

    exact = solve_ivp(rhs, (0, 0.5), np.concatenate([w.position_m[0], w.velocity_m_s[0]]), rtol=1e-11, atol=1e-12,
                      t_eval=0.01 * np.arange(1, HORIZON + 1)).y.T
    found = PublishedPhysics().predict(w)
    np.testing.assert_allclose(found.position_m[0], exact[:, :3], atol=1e-8)
    np.testing.assert_allclose(found.velocity_m_s[0], exact[:, 3:], atol=1e-8)
    turned = (start * Rotation.from_rotvec(rate * 0.5)).as_quat()
    assert so3.geodesic_angle(found.quaternion[0, -1], turned) < 1e-12


def split_of(flights, **faults):
    return task1.split(flights, {f.name: verdict(f, *faults.get(f.name, ())) for f in flights})


def test_the_earliest_of_each_trajectory_trains_whatever_its_name():
    first = made_flight("z_rep9", epoch_s=1e9, trajectory_id="A")
    second = made_flight("a_rep1", epoch_s=2e9, seed=1, trajectory_id="A")
    other = made_flight("m", epoch_s=3e9, seed=2, family="trefoil", trajectory_id="B")
    copy = replace(second, name="copy", provenance=replace(second.provenance, path="copy.csv"))
    piece = cut(other, 2.5, 15.0)
    found = split_of([second, copy, piece, other, first])
    assert [c.flight.name for c in found.train] == ["z_rep9"]
    assert {c.flight.name: c.groups for c in found.test} == {
        "a_rep1": ("all", "seen", "circle", "slow"), "m": ("all", "unseen", "trefoil", "slow")}
    assert "2 copies and slices left out" in found.note


def test_of_three_flights_of_different_paths_the_latest_is_tested_on():
    paths = ("circle", "figure_eight", "helix")
    flights = [made_flight(f"f{k}", epoch_s=1e9 * (k + 1), seed=k, family=path, trajectory_id=path)
               for k, path in enumerate(paths)]
    found = split_of(flights[::-1])
    assert sorted(c.flight.name for c in found.train) == ["f0", "f1"]
    assert [c.flight.name for c in found.test] == ["f2"]
    assert "every trajectory was flown once" in found.note
    with pytest.raises(InputError, match="no flight is left to test on"):
        split_of(flights[:2])


def test_of_three_flights_of_unknown_paths_the_latest_is_tested_on():
    flights = [made_flight(f"f{k}", epoch_s=1e9 * (k + 1), seed=k, family=None) for k in range(3)]
    found = split_of(flights[::-1])
    assert sorted(c.flight.name for c in found.train) == ["f0", "f1"]
    assert [c.flight.name for c in found.test] == ["f2"]
    assert found.note.startswith("no trajectory is one of circle, figure_eight")
    assert [c.flight.name for c in split_of(flights[:2]).test] == ["f0", "f1"]


def test_faulty_spans_are_left_out():
    first, second = made_flight("a"), made_flight("b", epoch_s=2e9, seed=1)
    found = split_of([first, second], b=[dead("imu", 10.0)])
    assert found.test[0].spans[-1].end_s == 10.0


def test_a_split_given_by_the_user_does_not_test_on_training_flights():
    first, second = made_flight("a"), made_flight("b", epoch_s=2e9, seed=1)
    audits = {f.name: verdict(f) for f in (first, second)}
    again = replace(first, name="again")
    found = task1.given_split([first], [again, second], {**audits, "again": audits["a"]})
    assert [c.flight.name for c in found.test] == ["b"]
    with pytest.raises(InputError, match="all 1 test recordings share rows with training ones"):
        task1.given_split([first], [again], {**audits, "again": audits["a"]})


def test_what_shares_rows_with_training_is_no_test_whatever_its_place_or_hash():
    first, second = made_flight("z"), made_flight("b", epoch_s=2e9, seed=1)
    copy = replace(first, name="a", provenance=replace(first.provenance, path="a.csv", sha256="0" * 64))
    later = replace(copy, name="a_later", epoch_s=first.epoch_s + 86400.0)
    audits = {f.name: verdict(f) for f in (first, second, copy, later)}
    found = task1.given_split([first], [copy, later, second], audits)
    assert [c.flight.name for c in found.train] == ["z"]
    assert [c.flight.name for c in found.test] == ["b"]
    assert found.left_out == {"a": "copy of z, which trains", "a_later": "copy of z, which trains"}
    early, late = cut(first, 2.0, 14.0, "early"), cut(first, 9.0, 20.0, "late")
    audits |= {f.name: verdict(f, airborne=(f.span,)) for f in (early, late)}
    for train, test in ((early, first), (first, early), (early, late)):
        found = task1.given_split([train], [test, second], audits)
        assert [c.flight.name for c in found.train] == [train.name]
        assert found.left_out == {test.name: f"shares rows with {train.name}, which trains"}
        assert "1 copies and slices left out" in found.note


def test_one_flight_trains_and_that_is_said():
    with pytest.raises(InputError, match="all 1 usable flights train; give --train and --test"):
        split_of([made_flight("alone")])
    with pytest.raises(InputError, match="all 1 usable flights train, 1 others share rows with them; give --train"):
        split_of([made_flight("alone"), made_flight("again", epoch_s=2e9)])


def test_nothing_to_test_on_names_the_streams():
    bare = made_flight("bare").without_streams("imu")
    with pytest.raises(InputError, match=r"bare\.csv: no test flight with mocap, imu"):
        split_of([bare])


@pytest.mark.parametrize(("change", "says"), [
    (lambda p: replace(p, position_m=p.position_m[:, :-1]), "position_m has shape"),
    (lambda p: replace(p, velocity_m_s=p.velocity_m_s * np.nan), "not finite"),
    (lambda p: replace(p, quaternion=0.0 * p.quaternion), "quaternion of length 0;"),
    (lambda p: replace(p, quaternion=1.01 * p.quaternion), "quaternion of length 1.01;"),
    (lambda p: None, "position_m")])
def test_what_is_no_prediction_is_said_in_one_line(change, says):
    class Bad(Naive):
        name = "bad"

        def predict(self, windows):
            return change(super().predict(windows))

    with pytest.raises(InputError, match=says) as caught:
        task1.score(task1.Case(made_flight(), (Span(5.0, 8.0),), ("all",)), Bad(), "mocap")
    assert "bad" in str(caught.value)


def test_rows_pool_windows_and_draw_flights():
    made = [made_flight(name, epoch_s=k * 1e9, seed=k) for k, name in enumerate("abc", start=1)]
    flights = [replace(f, provenance=replace(f.provenance, source="nanobench", synthetic=False)) for f in made]
    cases = [task1.Case(f, (Span(5.0, 6.0 + 2 * k),), ("all",)) for k, f in enumerate(flights)]
    scored = [(case, task1.score(case, Naive(), "onboard")) for case in cases]
    row = task1.tabulate(Naive(), "onboard", scored)[0]
    assert row.n_windows == sum(v.windows for _, v in scored)
    assert row.n_flights == 3
    for name in QUANTITIES:
        total = np.sum([v.sums[name] for _, v in scored], axis=0) / row.n_windows
        assert row.metrics[name]["50"] == pytest.approx(total[49])
        assert row.metrics[name]["sum"] == pytest.approx(total.sum())
        means = [np.sum(v.sums[name]) / v.windows for _, v in scored]
        if np.ptp(means) < 1e-12 * np.abs(means).max():
            assert row.ci95[name]["sum"] is None  # equal but for rounding: no interval
            continue
        low, high = row.ci95[name]["sum"]
        assert low <= row.metrics[name]["sum"] <= high
    assert row.published.published["position_mae_m"]["50"] == 0.2866
    foreign = [(replace(case, flight=mine), value) for mine, (case, value) in zip(made, scored, strict=True)]
    assert task1.tabulate(Naive(), "onboard", foreign)[0].published is None  # another vehicle than the published one
    assert task1.tabulate(Naive(), "onboard", scored[:1])[0].ci95["rate_mae_rad_s"]["1"] is None


@pytest.mark.slow
@pytest.mark.real
def test_the_real_rows(real):
    """Close to the figures of all airborne flights (other test set); the published row within its known distance."""
    flights, audits = real
    chosen = [f for f in flights if f.metadata.get("family") in ("circle", "figure_eight", "lissajous")]
    split = task1.split(chosen, audits)
    assert {c.groups[1] for c in split.test} == {"seen", "unseen"}
    found = {}
    for model in (Naive(), PublishedPhysics()):
        for truth in task1.TRUTHS:
            scored = [(case, task1.score(case, model, truth)) for case in split.test]
            found[model.name, truth] = task1.tabulate(model, truth, scored)[0].metrics
    naive, physics = found["naive", "onboard"], found["published_physics", "onboard"]
    assert naive["position_mae_m"]["50"] == pytest.approx(0.36, rel=0.15)
    assert physics["rate_mae_rad_s"] == naive["rate_mae_rad_s"]  # the rate is held in both
    assert physics["velocity_mae_m_s"]["1"] == pytest.approx(0.0489, rel=0.05)
    assert physics["velocity_mae_m_s"]["50"] / 50 == pytest.approx(physics["velocity_mae_m_s"]["1"], rel=0.1)
    assert found["naive", "mocap"]["position_mae_m"] == naive["position_mae_m"]
    assert found["naive", "mocap"]["attitude_mae_rad"]["1"] > naive["attitude_mae_rad"]["1"]


MODELS = ("naive", "published_physics", "residual_mlp", "physics_residual", "lstm")


def test_the_published_table_has_sixteen_cells_for_each_of_five_models():
    assert set(published()["task1"]["models"]) == set(MODELS)
    for name in MODELS:
        row = beside("task1", "models", name).published
        assert {(metric, h) for metric, cells in row.items() for h in cells} == {
            (metric, h) for metric in QUANTITIES for h in ("1", "10", "50", "sum")}
    assert beside("task1", "models", "lstm").published["rate_mae_rad_s"]["sum"] == 118.0662
    assert beside("task3", "groups", "Slow").published["ate_rmse_m"] == MeanStd(0.0211, 0.0033)
    assert beside("task3", "groups", "no such") is None


@pytest.mark.parametrize("name", ["naive", "published_physics"])
def test_published_sums_lie_between_what_errors_that_only_grow_can_add_up_to(name):
    """An error that never shrinks with the horizon is at least the last printed one, and at most the next."""
    for cells in beside("task1", "models", name).published.values():
        first, tenth, last = (cells[h] for h in ("1", "10", "50"))
        assert 9 * first + 40 * tenth + last <= cells["sum"] <= first + 9 * tenth + 40 * last


def test_the_published_physics_row_holds_the_rate_as_the_naive_row_does():
    rows = [beside("task1", "models", name).published["rate_mae_rad_s"] for name in ("naive", "published_physics")]
    assert rows[0] == rows[1]
