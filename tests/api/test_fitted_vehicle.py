"""``nb.fit`` and ``nanobench sysid`` give one vehicle; what it predicts and draws; real flights of every kind."""

import numpy as np
import pytest

import nanobench_tools as nb
from identification.greybox import ablation_study
from nanobench_tools.cli.main import main

SIX = ("B2_circle_medium_rep1", "B3_figure8_slow_rep1", "B5_helix_slow_rep1", "B7_oval_slow_rep2",
       "B8_star_medium_rep2", "B9_trefoil_medium_rep14")


@pytest.fixture(scope="module")
def flights(crowd):
    return [crowd.flight(name) for name in ("short circle", "short trefoil", "short helix")]


@pytest.fixture(scope="module")
def fitted(recordings_apart):
    """Of the two flights that train."""
    return nb.fit(nb.load(recordings_apart[0]))


@pytest.mark.slow
def test_the_command_line_exports_the_same_vehicle(recordings_apart, fitted, monkeypatch, tmp_path):
    monkeypatch.setattr(ablation_study, "SHORT", ("fit_vehicle",))
    train, test = recordings_apart
    assert main(["sysid", "--train", str(train), "--test", str(test), "--fit", "short", "--out", str(tmp_path)]) == 0
    assert (tmp_path / "simulator.toml").read_text() == fitted.to_toml()


@pytest.mark.slow
def test_the_plant_of_control_is_the_same_vehicle(recordings_apart, fitted):
    """Also with the command line: ``control --train``."""
    from nanobench_tools.cli.control_plants import Chosen
    from nanobench_tools.physics.simulator import loads
    from nanobench_tools.steps.options import Options

    train, _ = recordings_apart
    chosen = Chosen.of(Options(quiet=True), None, [train])
    assert loads(chosen.simulator) == loads(fitted.to_toml())
    assert chosen.draws[0] == loads(chosen.simulator).names


@pytest.fixture(scope="module")
def recordings_apart(flights, tmp_path_factory):
    """Folders of two flights that train and one that tests."""
    from nanobench_tools.sources.nanobench_writer import write_nanobench

    place = tmp_path_factory.mktemp("apart")
    folders = place / "train", place / "test"
    for number, flight in enumerate(flights):
        folder = folders[number == 2]
        folder.mkdir(exist_ok=True)
        write_nanobench(flight, folder / f"{flight.name}.csv")
    return folders


@pytest.mark.slow
def test_priors_are_marked_in_the_table(fitted):
    table = fitted.parameters_
    assert table.loc["yaw_torque.k_m", "prior_share"] == 1.0
    assert table.loc["yaw_torque.k_m", "ci_why"].startswith("prior: ")
    assert table.loc["thrust_scale.s", "prior_share"] < 0.5
    assert "priors" in repr(fitted)
    assert "prior" in fitted.summary()


@pytest.mark.slow
def test_the_vehicle_predicts_a_flight_by_itself(fitted, flights):
    found = fitted.predict(flights[0], by="vehicle")
    assert len(found.start_s) == len(found.predicted.position_m) > 20
    assert (np.diff(found.start_s) > 0.05).all()
    start = found.measured.position_m[:, 0]
    np.testing.assert_allclose(found.predicted.position_m[:, 0], start, atol=0.01)
    assert found.table["position_mae_m", 1].mean() < found.table["position_mae_m", 50].mean()
    assert flights[0].name in repr(found)


@pytest.mark.slow
def test_pictures_are_not_empty(fitted, flights):
    assert len(fitted.plot().data) == len(fitted.result.parameters)
    assert len(fitted.predict(flights[0], by="vehicle").plot().data) == 2


@pytest.mark.slow
def test_mistakes_are_one_line(fitted, flights, tmp_path):
    with pytest.raises(nb.UsageError, match="predictor or vehicle"):
        fitted.predict(flights[0], by="magic")
    with pytest.raises(nb.InputError, match="cannot be read"):
        nb.fit(flights, priors=tmp_path / "none.toml")
    with pytest.raises(nb.UsageError, match="priors belong"):
        nb.fit(flights, terms=["thrust_voltage"], priors=tmp_path / "none.toml")


def test_flights_that_cannot_be_used_are_one_line_with_the_reason(flights):
    with pytest.raises(nb.InputError, match="no mocap stream; none of 3 flights can be used"):
        nb.fit([flight.without_streams("mocap") for flight in flights])
    with pytest.raises(nb.UsageError, match="millimetres"):
        nb.fit(flights, arm_m=46.0)
    with pytest.raises(nb.UsageError, match="grams"):
        nb.fit(flights, mass_kg=41.0)


@pytest.mark.slow
def test_what_is_assumed_is_said(flights):
    found = nb.fit(flights[0].without_streams("battery"), mass_kg=0.03, arm_m=0.05)
    assert found.trouble == ""
    assert "30 g, 50 mm" in found.result.assumed[0]
    assert "3.7 V is assumed" in found.result.assumed[1]
    assert "assumed: battery voltage" in found.summary()
    assert found.model.vehicle.motor_positions_m[0][0] == pytest.approx(0.05 / 2**0.5)


@pytest.mark.slow
def test_the_predictor_scores_beside_the_vehicle(fitted, flights):
    table = fitted.score(flights[:1])
    assert set(table.index.get_level_values("model")) == {"fit_balanced", "simulator.toml", "simulator.toml + trim"}
    assert (table.loc["fit_balanced", "50"] > 0.0).all()
    assert fitted.predict(flights[0]).model == "fit_balanced"


@pytest.mark.slow
@pytest.mark.real
def test_every_kind_of_real_flights_gives_the_same_plausible_vehicle(real_data):
    """Six mixed flights, three trefoils and the straight line: hover within 2 % of the logged command, inertia within
    20 % and drag within 10 % of what rotor speeds and accelerometers of others and all flights together give."""
    folder = next(real_data.glob("nanobench/datasets/dataset"))
    sets = {"six": [folder / f"{name}.csv.xz" for name in SIX],
            "trefoil": sorted(folder.glob("B9_trefoil_*.csv.xz"))[:3],
            "linear_ramp": sorted(folder.glob("B6_linear_ramp_*.csv.xz"))[:3]}
    for name, mine in sets.items():
        assert len(mine) >= 3
        found = nb.fit(nb.load(mine))
        assert found.trouble == "", (name, found.trouble)
        assert found.result.flown.hover_ratio == pytest.approx(1.0, abs=0.02), name
        value = found.parameters_["value"]
        assert value["inertia.inertia_kg_m2[0]"] == pytest.approx(1.6e-5, rel=0.2), name
        assert 6e-3 <= value["yaw_torque.k_m"] <= 7e-3, name
        assert value["motor_lag.tau_up_s"] == pytest.approx(0.055, abs=0.01), name
        if name != "linear_ramp":  # it flies 2 m along x and never sideways
            assert value["drag_linear.d[1]"] == pytest.approx(0.016, rel=0.1), name
