"""``nanobench diagnose`` given recordings and simulators that it cannot judge: a clear answer or one line."""

import csv
import json
import shutil

import numpy as np
import pytest

from identification.mismatch.recordings import look_over
from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.cli.diagnose import _step
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.physics.simulator import write_simulator
from nanobench_tools.sources.discover import load_recordings

MOTORS = [f"motor_motor_m{i}" for i in (1, 2, 3, 4)]
BELIEVED = Model(Vehicle(), {"thrust_voltage": {"c": (-0.0248, 0.0652, -0.0268, 0.00678)},
                             "yaw_torque": {"k_m": 0.006}})


@pytest.fixture
def simulator(tmp_path):
    write_simulator(BELIEVED, tmp_path / "simulator.toml")
    return tmp_path / "simulator.toml"


@pytest.fixture
def changed(recordings, tmp_path):
    """(function of the table's columns {name: list}) -> folder with one recording so changed."""
    def make(change):
        source = sorted(recordings.glob("*.csv"))[0]
        with source.open() as file:
            header, *rows = csv.reader(file)
        table = change({name: [row[k] for row in rows] for k, name in enumerate(header)})
        folder = tmp_path / "changed"
        folder.mkdir()
        with (folder / source.name).open("w", newline="") as file:
            csv.writer(file).writerows([list(table), *zip(*table.values(), strict=True)])
        shutil.copy(source.with_name(f"{source.stem}_metadata.yaml"), folder)
        return folder

    return make


def verdict(nanobench, tmp_path, *arguments):
    code, _, err = nanobench("diagnose", *arguments, "--json", tmp_path / "v.json", "--jobs", 1, "--quiet")
    assert code == 0, err
    return json.loads((tmp_path / "v.json").read_text())


@pytest.mark.parametrize(("change", "words"), [
    (lambda t: {k: v for k, v in t.items() if k not in MOTORS}, "Without motor (m1, m2 and so on, one a rotor) the"),
    (lambda t: {k: v for k, v in t.items() if "gyro" not in k}, "inertia, lag and delay cannot be checked"),
    (lambda t: {k: v for k, v in t.items() if "vbat" not in k}, "One with thrust_pwm could be"),
    (lambda t: t | {k: ["30000"] * len(t[k]) for k in MOTORS}, "No conclusion about physics"),
    (lambda t: {k: v[:5] for k, v in t.items()}, "No conclusion about physics"),
])
def test_what_recordings_lack_is_said(nanobench, changed, simulator, tmp_path, change, words):
    found = verdict(nanobench, tmp_path, "--data", changed(change), "--simulator", simulator)
    assert found["outcome"] in ("insufficient", "data_fault")
    assert found["findings"] == []
    assert words in found["paragraph"]


@pytest.mark.slow
def test_without_voltage_trims_are_not_compared(nanobench, recordings, simulator, tmp_path):
    """Commands at an unknown voltage are no thrust, so several flights show as little as one."""
    folder = tmp_path / "unlogged"
    folder.mkdir()
    for source in sorted(recordings.glob("*.csv")):
        with source.open() as file:
            rows = list(csv.reader(file))
        kept = [k for k, name in enumerate(rows[0]) if "vbat" not in name]
        with (folder / source.name).open("w", newline="") as file:
            csv.writer(file).writerows([[row[k] for k in kept] for row in rows])
        shutil.copy(source.with_name(f"{source.stem}_metadata.yaml"), folder)
    found = verdict(nanobench, tmp_path, "--data", folder, "--simulator", simulator)
    assert found["outcome"] == "insufficient"
    assert "Without battery (vbat)" in found["paragraph"]


def test_cells_without_a_number_do_not_spread(changed):
    """Commands that were lost before a stretch begins are in no rotor of it."""
    def lose(table):
        lost = table | {k: [*v[:700], *[""] * 40, *v[740:]] for k, v in table.items() if k in MOTORS}
        return lost | {"pwr_pm_vbat": [*table["pwr_pm_vbat"][:650], "inf", *table["pwr_pm_vbat"][651:]]}

    flights = load_recordings([changed(lose)]).flights
    audits = {f.name: audit(f) for f in flights}
    tracks = look_over(flights, audits, flights, audits).tracks
    assert len(tracks) > 1
    for track in tracks:
        assert np.isfinite(track.motor).all()
        assert np.isfinite(track.battery_V).all()


@pytest.mark.slow
def test_another_vehicle_gets_no_finer_answer(nanobench, recordings, tmp_path):
    write_simulator(BELIEVED.on(mass_kg=0.4), tmp_path / "heavy.toml")
    found = verdict(nanobench, tmp_path, "--data", recordings, "--simulator", tmp_path / "heavy.toml")
    assert found["outcome"] == "insufficient"
    assert "of another vehicle" in found["paragraph"]
    assert found["thrust_ratio"] == pytest.approx(0.1, rel=0.2)


def test_swapped_recordings_are_told(nanobench, recordings, tmp_path):
    folder = tmp_path / "real"
    shutil.copytree(recordings, folder)
    for sheet in folder.glob("*.yaml"):
        sheet.write_text(sheet.read_text().replace("synthetic: true", "synthetic: false"))
    code, _, err = nanobench("diagnose", "--data", recordings, "--simulated", folder, "--jobs", 1, "--quiet")
    assert (code, "are they swapped?" in err) == (2, True)


@pytest.mark.slow
def test_a_callable_is_diagnosed(nanobench, recordings, tmp_path, monkeypatch):
    (tmp_path / "a_callable.py").write_text('''
def simulate(along):
    import numpy as np
    from nanobench_tools.physics.adapters.pwm import CURVE
    lift = sum(c * (along.motor * along.battery_V[:, None]) ** k for k, c in enumerate(CURVE.values))
    turn = np.stack([0.0325 * lift @ [-1, -1, 1, 1], 0.0325 * lift @ [-1, 1, 1, -1], 0.006 * lift @ [-1, 1, -1, 1]], 1)
    return lift.sum(axis=1)[:, None] * [0.0, 0.0, 1.0] / 0.0409, turn / [1.8e-5, 1.8e-5, 3.1e-5]
''')
    monkeypatch.syspath_prepend(tmp_path)
    found = verdict(nanobench, tmp_path, "--data", recordings, "--simulator", "a_callable:simulate", "--out",
                    tmp_path / "out", "--refit")
    assert ("parameters" in found["refit"]) == bool(found["findings"] and found["improvement"]["held_out"])
    assert found["refit"]["sentence"]
    assert found["simulator"]["alike"]
    assert "motor_lag" not in found["simulator"]["terms"]
    assert (tmp_path / "out" / "simulator_equivalent.toml").is_file()
    assert found["paragraph"].startswith("a_callable:simulate was evaluated along")


@pytest.mark.slow
def test_the_bound_of_a_network_stands_beside_what_was_named(recordings, monkeypatch):
    """The network is made up here: half the simulator's errors. What is named is not above it when it is nothing."""
    from types import SimpleNamespace

    from identification.learned import bound as learned
    from nanobench_tools.steps.diagnose_bound import errors_of, flexible

    def half(predictor, flights):
        before = errors_of(predictor, flights)
        return learned.Bound(before, {q: {h: 0.5 * e for h, e in row.items()} for q, row in before.items()},
                             len(flights), sum(len(w) for _, w, _ in flights))

    monkeypatch.setattr(learned, "flexible_bound", half)
    flights = load_recordings([recordings]).flights
    audits = {f.name: audit(f) for f in flights}
    said = []
    found = flexible(SimpleNamespace(say=said.append), SimpleNamespace(believed=None, corrected=None),
                     look_over(flights, audits, flights, audits), BELIEVED)
    assert found.share == dict.fromkeys(found.simulator, 0.0)
    assert found.corrected == found.simulator
    assert found.flexible["position_mae_m"]["50"] == 0.5 * found.simulator["position_mae_m"]["50"] > 0.0
    assert f"{found.windows} windows" in found.sentence
    hexa = SimpleNamespace(rotors=6)
    assert flexible(SimpleNamespace(say=said.append), SimpleNamespace(), look_over(flights, audits, flights, audits),
                    hexa) is None
    assert "four motors" in said[-1]


def test_a_refit_needs_paths(nanobench, recordings, simulator):
    code, _, err = nanobench("diagnose", "--data", recordings, "--normal", recordings, "--simulator", simulator,
                             "--refit", "--quiet")
    assert (code, "--refit predicts paths" in err, err.count("\n")) == (2, True, 1)


@pytest.mark.parametrize(("given", "words"), [
    ("absent.toml", "absent.toml: cannot be read"), ("nothing", "no adapter of that name"),
    ("no_module:f", "No module named"), ("rotorpy:absent.toml", "absent.toml: cannot be read")])
def test_a_simulator_that_is_not_there_is_one_line(nanobench, recordings, given, words):
    code, _, err = nanobench("diagnose", "--data", recordings, "--simulator", given, "--quiet")
    assert code == 2
    assert words in err
    assert err.count("\n") == 1


@pytest.mark.parametrize("option", ["--same-day", "--nothing-added", "--same-vehicle"])
def test_what_is_known_of_normal_flights_goes_with_them(nanobench, recordings, option):
    for verb in (("diagnose", "--data", recordings, "--simulator", "x.toml"), ("prove", "--cases", "1")):
        code, _, err = nanobench(*verb, option)
        assert (code, err.count("\n")) == (2, 1)
        assert option in err


@pytest.mark.parametrize(("before", "after", "shown"), [
    (0.05664, 0.05661, "0.0566 -> 0.0566"), (0.05664, 0.05664, "0.0566"), (None, None, "given")])
def test_an_error_that_nothing_corrects_stands_once(before, after, shown):
    assert _step(before, after) == shown
