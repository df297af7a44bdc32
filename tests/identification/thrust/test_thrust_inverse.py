"""Thrust to PWM and back, the limit the battery sets, and what is exported."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_stands import dc_law, drive, made

from identification.thrust.firmware import motor_voltage
from identification.thrust.inverse import invert
from identification.thrust.map_export import export
from identification.thrust.maps import MAPS
from identification.thrust.stand_fit import fit_stands

FITTED = [n for n, m in MAPS.items() if m.fixed is None]
FITS = {n: fit_stands(MAPS[n], [made(dc_law, noise_N=2e-4)]) for n in FITTED}


@settings(max_examples=60, deadline=None)
@given(st.floats(0.3, 1.0), st.floats(3.2, 4.1), st.sampled_from(FITTED))
def test_round_trip(u, voltage, name):
    predict = FITS[name].predict
    back = invert(predict, predict(u, voltage), voltage)
    assert not back.saturated
    assert float(back.thrust_N) == pytest.approx(float(predict(u, voltage)), abs=1e-12)
    assert float(back.pwm) == pytest.approx(u, abs=1e-6)


def test_more_than_the_battery_gives_is_said():
    predict = FITS["dc_motor"].predict
    found = invert(predict, np.array([0.02, 9.0, 1e-9]), 3.5)
    assert found.saturated.tolist() == [False, True, False]
    assert found.pwm[1] == 1.0
    assert found.thrust_N[1] == found.limit_N[1] == pytest.approx(float(predict(1.0, 3.5)))


def test_limit_falls_with_the_battery():
    limits = invert(FITS["dc_motor"].predict, 9.0, np.linspace(4.1, 3.0, 12)).limit_N
    assert np.all(np.diff(limits) < 0.0)


def test_a_map_that_falls_at_low_pwm_has_one_answer():
    def bowl(u, voltage):
        return 0.1 * (np.asarray(u) - 0.2) ** 2 + 0.0 * voltage

    found = invert(bowl, np.array([0.01, 0.0]), 3.7)
    assert found.pwm[0] == pytest.approx(0.2 + np.sqrt(0.1))


def test_term_says_what_the_map_says():
    fit = FITS["thrust_voltage"]
    found = export(fit, (0.2, 1.0), (3.2, 4.1))
    c = found.terms[0]["c"]
    u, voltage = drive(50, seed=5)
    assert np.allclose(np.polynomial.polynomial.polyval(u * voltage, c), fit.predict(u, voltage), atol=1e-12)
    assert found.rms_N == 0.0
    assert 'name = "thrust_voltage"' in found.toml()


@pytest.mark.parametrize("name", ["dc_motor", "switched_motor", "pwm_voltage"])
def test_firmware_constants_invert_in_the_firmware(name):
    """The lines hold a cubic that the firmware's own formula inverts over all its commands, in its own precision."""
    found = export(FITS[name], (0.15, 1.0), (3.2, 4.1))
    c = [float(line.split()[2].rstrip("f")) for line in found.firmware.splitlines() if "VMOTOR2THRUST" in line]
    least, most = (float(next(x for x in found.firmware.splitlines() if key in x).split()[2].rstrip("f"))
                   for key in ("THRUST_MIN", "THRUST_MAX"))
    asked = np.linspace(least, most, 50)
    for kind, within in ((np.float64, 1e-5), (np.float32, 0.005 * most)):
        volts = motor_voltage(asked, c, kind).astype(float)
        assert np.abs(np.polynomial.polynomial.polyval(volts, c) - asked).max() < within
