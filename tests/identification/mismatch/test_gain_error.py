"""Error of a gain that noise of the command lowers."""

from __future__ import annotations

import numpy as np
import pytest

from identification.mismatch.posterior.gain_error import gain_error


def test_the_error_of_a_gain_covers_what_noise_of_the_command_takes_from_it():
    """Least squares against a gain of 1 that is known: its error is within two standard deviations, with noise that
    takes 20 % and 80 % of the gain, and a mean that differs between flights changes nothing."""
    rng, flight = np.random.default_rng(3), np.repeat(np.arange(4), 2000)
    true = rng.normal(size=len(flight))
    for noise in (0.5, 2.0):
        command = true + noise * rng.normal(size=len(flight))
        gain = command @ true / (command @ command)
        error = gain_error(command, true, flight)
        assert 1.0 - gain == pytest.approx(noise**2 / (1.0 + noise**2), abs=0.03)
        assert 1.0 - gain < 2.0 * error < 2.0
        assert gain_error(command + 5.0 * flight, true - 3.0 * flight, flight) == pytest.approx(error)
    assert gain_error(np.zeros(8), np.arange(8.0), np.zeros(8)) == pytest.approx(3.0**-0.5)
