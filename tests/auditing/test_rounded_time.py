"""Timestamps rounded to steps that the rate does not fit are a finding; rows lost from a regular log are not."""

import re

import numpy as np
import pytest

from nanobench_tools.auditing.faults import rounded_time
from nanobench_tools.flight import Flight, Provenance, make_stream
from nanobench_tools.signals.context import Context

RNG = np.random.default_rng(5)


def _found(t):
    stream = make_stream("battery", t, np.linspace(4.2, 3.4, len(t))[:, None], ("vbat",))
    flight = Flight("made", {"battery": stream}, {}, Provenance("made", "", "test"))
    return rounded_time.find(flight, Context(flight))


def _every(rate_hz, rounding_s, start_s=0.0, lost=0.0, jitter_s=0.0):
    t = start_s + np.arange(0.0, 20.0, 1.0 / rate_hz)
    t = t[RNG.uniform(size=len(t)) >= lost]
    return np.round((t + jitter_s * RNG.uniform(-1.0, 1.0, len(t))) / rounding_s) * rounding_s


@pytest.mark.parametrize(("rate_hz", "rounding_s"), [(40.0, 0.01), (30.0, 0.01), (60.0, 0.01), (90.0, 0.01),
                                                     (400.0, 0.001), (8.0, 0.1), (33.0, 0.02), (240.0, 0.002)])
@pytest.mark.parametrize("start_s", [0.0, 1.7e9 + 0.003])
def test_a_rate_that_does_not_fit_the_rounding_is_found_with_both(rate_hz, rounding_s, start_s):
    (fault,) = _found(_every(rate_hz, rounding_s, start_s))
    assert fault.size == pytest.approx(rounding_s)
    evenly, hertz = re.search(r"evenly (\S+) ms apart \((\S+) Hz\)", fault.evidence).groups()
    assert float(evenly) == pytest.approx(1e3 / rate_hz, rel=0.01)
    assert float(hertz) == pytest.approx(rate_hz, rel=0.01)


def test_an_uneven_log_in_hundredths_is_known_no_better():
    (fault,) = _found(_every(30.0, 0.01, jitter_s=0.012))
    assert "unevenly" in fault.evidence


@pytest.mark.parametrize("t", [
    _every(100.0, 0.01), _every(100.0, 0.01, lost=0.05), _every(100.0, 0.01, lost=0.3), _every(50.0, 0.01, lost=0.2),
    _every(40.0, 0.001), _every(120.0, 0.001), _every(100.0, 0.001, jitter_s=0.003), _every(40.0, 1e-6, 1.7e9),
], ids=["even", "lost rows", "many lost rows", "every other hundredth", "fits", "milliseconds", "jitter", "unix time"])
def test_even_rows_lost_rows_and_fine_timestamps_are_no_finding(t):
    assert _found(t) == []


def test_rows_of_one_timestamp_are_another_finding():
    assert _found(_every(250.0, 0.01)) == []
