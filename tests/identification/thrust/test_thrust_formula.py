"""The formula of a map: evaluated as it is written, it gives what the map gives; levels at hover and full command."""

import re

import numpy as np
import pytest

from identification.thrust.maps import MAPS
from identification.thrust.thrust_formula import formula_of, voltage_varies, written

UNIT = re.compile(r"(?<=\d) (?:N|V|1)(?:/V)?(?:\^\d)?(?=[ )]|$)")
VALUES = {"thrust_pwm": [0.01, 0.03, 0.12], "thrust_voltage": [-0.004, 0.032, -0.0096, 0.0042],
          "pwm_voltage": [0.001, 0.01, 0.002, 0.003, 0.004, 0.0005], "power_law": [0.012, 1.7, 1.6],
          "dc_motor": [0.015, 0.08, 0.05], "switched_motor": [0.009, 0.11, 0.9]}


def values_of(candidate):
    if candidate.fixed is not None:
        return {name: c for (name, _), c in zip(candidate.linear, candidate.fixed, strict=True)}
    names = [name for name, _ in candidate.linear] + [shape.name for shape in candidate.shape]
    return dict(zip(names, VALUES.get(candidate.name, [0.94]), strict=True))


@pytest.mark.parametrize("name", MAPS)
def test_the_text_is_the_map(name):
    candidate = MAPS[name]
    values = values_of(candidate)
    text = written(candidate, values, scale=1.02)
    assert text.startswith("T = ")
    assert re.search(r"\d N|\d \* \(", text)
    plain = UNIT.sub("", text.removeprefix("T = ")).replace("^", "**")
    for u, voltage in ((0.5, 3.3), (0.8, 3.9), (1.0, 4.1)):
        evaluated = eval(plain, {"u": u, "V": voltage})
        expected = 1.02 * float(candidate.thrust(values, np.array(u), voltage))
        assert evaluated == pytest.approx(expected, rel=5e-3), plain


def test_levels_at_a_full_and_an_empty_battery():
    """A motor whose thrust is 0.01 N/V^2 (u V)^2: 0.1764 N at 4.2 V, hover of 40 g at u V = 3.13 V."""
    found = formula_of("T = ...", lambda u, volts: 0.01 * (np.asarray(u) * volts) ** 2, 0.04, 9.81, (3.2, 4.25))
    full, empty = found.levels
    assert (full.battery, full.voltage_V, full.measured) == ("full", 4.2, True)
    assert full.full_N == pytest.approx(0.1764)
    assert full.hover_pwm == pytest.approx(np.sqrt(0.0981 / 0.01) / 4.2, abs=1e-3)
    assert full.thrust_to_weight == pytest.approx(0.1764 / 0.0981)
    assert (empty.hover_pwm, empty.measured) == (None, False)
    assert "no hover" in found.sentence
    assert "extrapolated" in found.sentence


def test_a_battery_of_several_cells_is_full_and_empty_as_a_whole():
    found = formula_of("T = ...", lambda u, volts: 0.05 * np.asarray(u) * volts, 1.0, 9.81, (14.0, 16.5))
    assert [level.voltage_V for level in found.levels] == pytest.approx([16.8, 12.0])


def test_an_assumed_mass_is_marked():
    found = formula_of("T = ...", lambda u, volts: 0.01 * (np.asarray(u) * volts) ** 2, 0.04, 9.81, (3.2, 4.25))
    assert found.sentence.startswith("Hover of 40 g takes ")
    assert found.described("--mass").startswith("Hover of 40 g (assumed: give --mass) takes ")


def test_a_voltage_that_follows_from_the_command_shows_no_dependence_on_it():
    u = np.tile(np.linspace(0.1, 1.0, 20), 2)
    assert not voltage_varies(u, 16.4 - 1.5 * u**2)
    assert not voltage_varies(np.tile(u[:, None], 4), 16.4 - 1.5 * u**2)
    assert voltage_varies(u, 4.0 - 0.5 * u - 0.3 * (np.arange(40) >= 20))
    found = formula_of("T = ...", lambda u, volts: 0.01 * (np.asarray(u) * volts) ** 2, 0.04, 9.81, (15.0, 16.4), False)
    assert found.levels == ()
    assert found.sentence.startswith("2.25 N per motor at full command and 15.00 V. ")
    assert "do not show how thrust depends on voltage" in found.sentence
