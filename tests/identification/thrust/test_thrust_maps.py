"""The maps against the firmware's published check values, the motor balance, and CasADi."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from identification.thrust.firmware import LEGACY, PLUS, motor_voltage
from identification.thrust.map_export import casadi_function
from identification.thrust.maps import MAPS, speed_voltage
from identification.thrust.stand_fit import Fit
from nanobench_tools.physics.ops import NUMPY

SHAPES = {"power_law": {"a": 1.7, "b": 1.4}, "dc_motor": {"rho": 0.1, "e_0": -0.02},
          "switched_motor": {"e_0": 0.7, "s": 1.5}}


def some_fit(name: str) -> Fit:
    candidate = MAPS[name]
    fixed = candidate.fixed or [0.01 / (k + 1) for k in range(len(candidate.linear))]
    return Fit(candidate, {n: c for (n, _), c in zip(candidate.linear, fixed, strict=True)} | SHAPES.get(name, {}))


@pytest.mark.parametrize(("volts", "newton"), [(3.0, 0.1128), (3.3, 0.1423), (3.7, 0.1931), (4.0, 0.2412),
                                                (4.2, 0.2787)])
def test_firmware_at_full_duty(volts, newton):
    """Full-duty thrust per motor of the 2.1+ curve, as worked out from the firmware's source."""
    assert float(some_fit("firmware_2_1_plus").predict(1.0, volts)) == pytest.approx(newton, abs=6e-5)


@pytest.mark.parametrize(("newton", "volts"), [(0.01282, 0.7739), (0.0711225, 2.3992), (0.12, 3.0799)])
def test_firmware_inverse_check_values(newton, volts):
    assert float(motor_voltage(newton, PLUS.c)) == pytest.approx(volts, abs=3e-4)


@given(st.floats(0.013, 0.2))
def test_firmware_inverse_is_the_inverse(newton):
    for propellers in (PLUS, LEGACY):
        back = np.polynomial.polynomial.polyval(motor_voltage(newton, propellers.c), propellers.c)
        assert back == pytest.approx(newton, rel=1e-9)


@given(st.floats(0.0, 5.0), st.floats(0.0, 5.0))
def test_motor_balance_holds(drive, rho):
    speed = float(speed_voltage(np.float64(drive), rho, NUMPY))
    assert speed + rho * speed**2 == pytest.approx(drive, abs=1e-12, rel=1e-12)


def test_no_thrust_below_zero():
    for name in MAPS:
        assert np.all(some_fit(name).predict(np.linspace(0.0, 1.0, 41), 3.7) >= 0.0)


@pytest.mark.parametrize("name", MAPS)
def test_casadi_twin(name):
    fit = some_fit(name)
    function = casadi_function(fit)
    rng = np.random.default_rng(3)
    for u, voltage in zip(rng.uniform(0.05, 1.0, 25), rng.uniform(3.0, 4.2, 25), strict=True):
        assert float(function(u, voltage)) == pytest.approx(float(fit.predict(u, voltage)), abs=1e-12)
