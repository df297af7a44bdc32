"""``nb.thrust``: a formula that is evaluated, its table and its levels, from stands and from flights."""

import numpy as np
import pytest

import nanobench_tools as nb


@pytest.fixture(scope="module")
def stand(tmp_path_factory):
    """Two tables of one thrust stand, in the form of the public ones: four motors of 0.011 N/V^2 (u V)^2 each."""
    folder = tmp_path_factory.mktemp("stand")
    for name, levels in (("first", (4.1, 3.7, 3.3)), ("second", (4.0, 3.6, 3.2))):
        pwm = np.tile(np.linspace(8000, 65000, 30).astype(int), len(levels))
        volts = np.repeat(levels, 30)
        newton = 4 * 0.011 * (pwm / 65535 * volts) ** 2
        speed = 20000 * np.sqrt(newton)
        rows = "\n".join(f"{p},{v:.3f},{w:.0f},{w:.0f},{w:.0f},{w:.0f},{n / 9.81e-3:.3f}"
                         for p, v, w, n in zip(pwm, volts, speed, newton, strict=True))
        (folder / f"{name}.csv").write_text("pwm,vbat[V],rpm1,rpm2,rpm3,rpm4,thrust[g]\n" + rows + "\n")
    return nb.load(folder)


@pytest.fixture(scope="module")
def found(stand):
    return nb.thrust(stand, mass_kg=0.0408)


@pytest.mark.slow
def test_a_stand_gives_a_formula_that_can_be_evaluated(found):
    assert found.formula.startswith("T = ")
    assert "N" in found.formula
    command, battery_V = np.array([0.4, 0.7, 0.9]), 3.8
    expected = 0.011 * (command * battery_V) ** 2
    np.testing.assert_allclose(found.thrust_N(command, battery_V), expected, rtol=0.03)
    np.testing.assert_allclose(found.command(expected, battery_V), command, atol=0.02)
    np.testing.assert_allclose(found(0.7, battery_V), expected[1], rtol=0.03)


@pytest.mark.slow
def test_levels_and_table_have_units_and_say_what_was_measured(found):
    assert list(found.levels.index) == ["full", "empty"]
    full = found.levels.loc["full"]
    assert full["full_N"] == pytest.approx(0.011 * 4.2**2, rel=0.05)
    assert full["hover_pwm"] == pytest.approx(np.sqrt(0.0408 * 9.81 / 4 / 0.011) / 4.2, abs=0.02)
    assert not full["measured"]
    assert set(found.table["unit"]) == {"N per motor"}
    assert found.best in found.table.index.get_level_values("model")
    assert "extrapolated" in found.sentence


@pytest.mark.slow
def test_it_draws_its_curves(found):
    assert len(found.plot().data) >= 5


@pytest.mark.slow
def test_a_command_in_counts_and_a_mass_in_grams_are_one_line(stand, found):
    with pytest.raises(nb.UsageError, match="65535"):
        found.thrust_N(40000, 3.8)
    with pytest.raises(nb.UsageError, match="grams"):
        nb.thrust(stand, mass_kg=40.8)
