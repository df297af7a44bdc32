"""``nanobench convert SIMULATOR.toml``: one vehicle into other simulators."""

import json
from types import SimpleNamespace

import pytest

from nanobench_tools.cli.convert import ALL, SIMULATORS
from nanobench_tools.cli.sysid_models import SIMULATOR, exported
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.physics.export import TARGETS
from nanobench_tools.physics.hover import hover
from nanobench_tools.physics.simulator import read_simulator, write_simulator
from nanobench_tools.steps.options import Options

TERMS = {"thrust_voltage": {"c": (0.0056, 0.0368, -0.0016)}, "motor_lag": {"tau_up_s": 0.03, "tau_down_s": 0.04},
         "yaw_torque": {"k_m": 0.006}, "drag_linear": {"d": (0.0105, 0.0105, 0.0032)}, "drag_torque": {"c": -3e-4}}


@pytest.fixture
def simulator(tmp_path):
    path = tmp_path / "simulator.toml"
    write_simulator(Model(Vehicle(), TERMS), path)
    return path


def test_the_verb_offers_what_there_is():
    assert tuple(TARGETS) == SIMULATORS


def test_all_simulators_at_once(nanobench, simulator, tmp_path):
    out = tmp_path / "out"
    code, shown, err = nanobench("convert", simulator, "--to", ALL, "--out", out, "--battery", 3.9)
    assert (code, err) == (0, "")
    assert len(shown.splitlines()) < 24
    (urdf,) = [line for line in shown.splitlines() if line.startswith("urdf")]
    assert "motor_lag" in urdf
    shown = nanobench("convert", simulator, "--to", ALL, "--out", out, "--battery", 3.9, "--verbose")[1]
    assert "urdf:" in shown
    assert "LEFT OUT: motor_lag" in shown
    assert "assumed: battery_V: 3.9 V" in shown
    body = json.loads((out / "convert.json").read_text())
    assert sorted(body["simulators"]) == sorted(SIMULATORS)
    assert "drag_torque" in body["simulators"]["crazyflow"]["left_out"]
    assert body["simulators"]["c"]["left_out"] == {}
    assert body["simulator"] == str(simulator)
    assert [file for file in body["files"] if not (tmp_path / file).is_file()] == []


def test_it_says_how_the_vehicle_hovers_and_doubts_a_yaw_that_no_propeller_has(nanobench, simulator, tmp_path):
    code, shown, _ = nanobench("convert", simulator, "--to", "c", "--out", tmp_path / "c")
    assert code == 0
    assert "PWM ratio (3.7 V); 1 % more and less of the motors turns it by roll" in shown
    assert "WARNING" not in shown
    write_simulator(Model(Vehicle(), {**TERMS, "yaw_torque": {"k_m": 1.2e-5}}), simulator)
    code, shown, _ = nanobench("convert", simulator, "--to", "c", "--out", tmp_path / "c")
    assert code == 0
    assert "WARNING: yaw_torque.k_m is 1.2e-05 m" in shown
    body = json.loads((tmp_path / "c" / "convert.json").read_text())
    assert body["hover"]["authority_rad_s2"] == pytest.approx(hover(read_simulator(simulator)).authority_rad_s2)


def test_one_simulator_and_nothing_but_json(nanobench, simulator, tmp_path):
    code, shown, _ = nanobench("convert", simulator, "--to", "urdf", "--out", tmp_path / "out", "--json", "-")
    assert code == 0
    assert json.loads(shown)["files"] == [str(tmp_path / "out" / "cf2x.urdf")]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["cf2x.urdf", "convert.json"]


@pytest.mark.parametrize(("arguments", "hint"), [
    (("--to", "rotorpy", "--out", "o"), "--to rotorpy needs a SIMULATOR.toml"),
    (("SIM", "--out", "o"), "--to nanobench is for recordings; give one of rotorpy"),
    (("SIM", "--to", "rotorpy"), "--out DIR is needed"),
    (("SIM", "--to", "gazebo", "--out", "o"), "gazebo"),
    (("absent.toml", "--to", "c", "--out", "o"), "absent.toml: cannot be read"),
    (("SIM", "--to", "rotorpy", "--out", "o", "--data", "x"), "other paths and --mocap do not go with"),
    (("SIM", "--to", "rotorpy", "--out", "o", "--battery", "0"), "assumed battery_V: 0.0; give a number from 1 to 60"),
    (("SIM", "--to", "rotorpy", "--out", "o", "--battery", "1.5"), "cannot hover"),
    (("--battery", "3.7", "--out", "o"), "--battery and --k-f belong to a SIMULATOR.toml")])
def test_bad_usage_is_one_line(nanobench, simulator, arguments, hint, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, out, err = nanobench("convert", *(simulator if a == "SIM" else a for a in arguments))
    assert (code, out) == (2, "")
    assert hint in err
    assert err.count("\n") == 1
    assert not (tmp_path / "o").exists()


@pytest.mark.parametrize(("mass_kg", "said"), [(0.04085, ""), (0.5, "not written for urdf: model: cannot hover")])
def test_sysid_writes_its_best_model_for_all_of_them(mass_kg, said, tmp_path, capsys):
    fitted = SimpleNamespace(simulator=TERMS, physical=False, result=SimpleNamespace(remarks={}))
    best = SimpleNamespace(vehicle=Vehicle(mass_kg=mass_kg)), fitted
    written = exported(Options(out=tmp_path), {"best": best}, "best", "simulator_retimed.toml")
    assert written.path == str(tmp_path / "simulator_retimed.toml")
    assert [p.name for p in written.predictors] == [SIMULATOR]
    assert written.predictors[0].model == read_simulator(written.path)
    assert said in capsys.readouterr().err
    written = {file.name for file in (tmp_path / "simulators_retimed").iterdir()}
    assert {"model.c", "model_step.casadi"} <= written
    assert (not said) == ({"rotorpy_params.json", "cf2x.urdf", "crazyflow_params.toml"} <= written)


def test_a_wrong_line_of_the_file_is_named(nanobench, simulator, tmp_path):
    simulator.write_text(simulator.read_text().replace("k_m = 0.006", "k_m = -0.006"))
    code, _, err = nanobench("convert", simulator, "--to", "rotorpy", "--out", tmp_path / "o")
    assert code == 2
    assert "key k_m" in err


def test_a_controller_for_the_firmware(nanobench, simulator, tmp_path):
    write_simulator(Model(Vehicle(), {**TERMS, "command_delay": {"delay_s": 0.02}}), simulator)
    code, shown, err = nanobench("convert", simulator, "--to", "firmware-app", "--out", tmp_path / "app")
    assert (code, err) == (0, "")
    assert "ESTIMATE" in shown
    body = json.loads((tmp_path / "app" / "convert.json").read_text())["simulators"]["firmware-app"]
    assert "command_delay" in body["left_out"]
    assert "motor_lag" in body["approximated"]
    for name in ("Kbuild", "app-config", "Makefile", "README.md", "src/vehicle_parameters.h", "src/daqp/LICENSE"):
        assert (tmp_path / "app" / name).is_file()
    turned = Model(Vehicle(spin=(1.0, -1.0, 1.0, -1.0)), TERMS)
    write_simulator(turned, simulator)
    code, _, err = nanobench("convert", simulator, "--to", "firmware-app", "--out", tmp_path / "no")
    assert code != 0
    assert "not in the order of the Crazyflie" in err
    assert len(err.strip().splitlines()) == 1
    assert not (tmp_path / "no").exists()


def test_an_estimator_for_the_firmware(nanobench, simulator, tmp_path):
    code, shown, err = nanobench("convert", "--to", "firmware-filter", "--out", tmp_path / "filter")
    assert (code, err) == (0, "")
    assert "ESTIMATE" in shown
    body = json.loads((tmp_path / "filter" / "convert.json").read_text())
    assert [file for file in body["files"] if not (tmp_path / file).is_file()] == []
    assert "#define LATE_MOVES 0.0f" in (tmp_path / "filter" / "src" / "filter_settings.h").read_text()
    code, _, err = nanobench("convert", simulator, "--to", "firmware-filter", "--out", tmp_path / "no")
    assert code != 0
    assert "takes --out alone" in err
    assert not (tmp_path / "no").exists()
