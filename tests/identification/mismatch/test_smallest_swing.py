"""SYNTHETIC hovering flights: a swing of the size that was stated is found, far smaller ones are not."""

import numpy as np
import pytest
from hover_flights import hover

from identification.mismatch.steady.periodic import Swing, frequencies, swing_in, swing_of
from identification.mismatch.steady.reconstruct import states_of
from identification.mismatch.steady.smallest_swing import _window, say, smallest_swing
from identification.mismatch.steady.trim import runs_of
from nanobench_tools.auditing.recording_audit import audit

MASS_KG = 0.033


def seen(flight):
    states = states_of(flight)
    return swing_in(states, runs_of(flight, audit(flight), flight["motor"].values, states.time_s))


@pytest.fixture(scope="module")
def usual():
    return [seen(hover(f"n{k}", seed=k)) for k in range(4)]


@pytest.fixture(scope="module")
def stated(usual):
    return smallest_swing([seen(hover(f"s{k}", seed=10 + k)) for k in range(3)], usual, MASS_KG)


@pytest.mark.slow
def test_a_swing_of_the_stated_size_is_found_and_far_smaller_ones_are_not(usual, stated):
    assert stated["axes"] == ["left"]  # no pitch is logged
    assert stated["force_N"] == pytest.approx(MASS_KG * stated["minimum_detectable"])
    found, small = [], []
    for k, hertz in enumerate(np.linspace(*stated["band_hz"], 6)):
        least = min(stated["by_hz"], key=lambda row: abs(row[0] - hertz))[1]

        def hung(share, hertz=hertz, least=least, k=k):
            flights = [seen(hover(f"h{i}", seed=100 + 10 * k + i, swing=(share * least, hertz))) for i in range(3)]
            return swing_of(flights, usual)

        swing = hung(1.3)
        found.append(swing is not None and abs(swing["frequency_hz"] - hertz) < 0.06)
        small.append(hung(0.3) is None)
    assert sum(found) >= 5
    assert all(small)


def test_the_sentence_has_size_axis_band_and_string(stated):
    text = say(stated)
    for words in ("m/s^2", "to the left and right", "mN", "0.5 to 1.4 Hz", "strings of 0.13 to 0.99 m"):
        assert words in text
    assert "cannot be detected" in say({"minimum_detectable": None, "why": "no tilt"})
    assert say(None) == ""


def test_what_cannot_be_seen_has_no_size(usual):
    blind = Swing(np.full((len(frequencies()), 2), np.nan), 0, np.full((len(frequencies()), 3), np.nan),
                  np.full(2, np.nan), 0.0)
    assert "these flights" in smallest_swing([blind], usual, MASS_KG)["why"]
    assert "normal flights" in smallest_swing(usual[:1], [blind], MASS_KG)["why"]
    assert "none were given" in smallest_swing(usual[:1], [], MASS_KG)["why"]


def test_the_window_is_that_of_a_sum():
    """Against the sum over a run of 10 s itself."""
    t = np.arange(0.0, 10.0, 0.01)
    for bins in (0.0, 0.3, 1.0, 1.7, 2.5):
        summed = abs(np.hanning(len(t)) @ np.exp(2j * np.pi * bins / 10.0 * t)) / np.hanning(len(t)).sum()
        assert abs(_window(np.array(bins))) == pytest.approx(summed, abs=3e-3)
