"""What class ``past`` sees ends at the start of the window; predictions do not depend on company."""

import sys
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from nanobench_tools.flight import Span
from nanobench_tools.protocols.task1 import Case
from nanobench_tools.protocols.windows import PAST_ALL, cut_windows
from nanobench_tools.results import array_fields

sys.path.insert(0, str(Path(__file__).parents[2] / "protocols"))
from made_flights import made_flight

SPANS = (Span(3.0, 12.0),)
WINDOW = 40


def spoiled(flight, start_s):
    """Everything later than ``start_s`` is noise; motors and battery only from the end of the window on."""
    rng = np.random.default_rng(0)
    streams = {}
    for name, stream in flight.streams.items():
        late = stream.time_s > start_s + (0.495 if name in ("motor", "battery") else 0.0) + 1e-6
        values = stream.values.copy()
        values[late] = rng.normal(size=(late.sum(), values.shape[1]))
        streams[name] = replace(stream, values=values)
    return replace(flight, streams=streams)


@pytest.mark.parametrize("truth", ["onboard", "mocap"])
def test_nothing_later_than_the_start_is_seen(truth):
    flight = made_flight("made")
    windows, _ = cut_windows(flight, SPANS, truth, past=True)
    start_s = flight["mocap"].time_s[np.searchsorted(flight["mocap"].time_s, SPANS[0].start_s) + 10 * WINDOW]
    again, _ = cut_windows(spoiled(flight, start_s), SPANS, truth, past=True)
    for field in fields(windows):
        if isinstance(getattr(windows, field.name), np.ndarray):
            np.testing.assert_array_equal(getattr(windows, field.name)[WINDOW], getattr(again, field.name)[WINDOW])
    for field in fields(windows.past):
        np.testing.assert_array_equal(getattr(windows.past, field.name)[WINDOW],
                                      getattr(again.past, field.name)[WINDOW], field.name)
    assert not np.array_equal(windows.position_m[WINDOW + 1], again.position_m[WINDOW + 1])


def test_past_ends_one_row_before_the_start_and_says_how_much_was_flown():
    flight = made_flight("made")
    windows, _ = cut_windows(flight, SPANS, "onboard", past=True)
    np.testing.assert_array_equal(windows.past.position_m[1, -10:], flight["mocap"]["px", "py", "pz"][300:310])
    assert windows.past.rows[:3].tolist() == [0, 10, 20]
    assert windows.past.rows[-1] == PAST_ALL
    np.testing.assert_array_equal(windows.past.motor[:, -50:], windows.motor_past)


def test_class_state_is_not_given_the_past():
    windows, _ = cut_windows(made_flight("made"), SPANS, "onboard")
    assert windows.past is None


@pytest.mark.parametrize("adapt", ["inputs", "past"])
def test_a_prediction_does_not_depend_on_the_other_windows_and_not_on_the_future(adapt):
    from made_windows import TERMS

    from identification.greybox.fit import nuisances_of
    from identification.greybox.fitted_predictor import GreyBoxPredictor
    from identification.greybox.nuisance import terms_of
    from nanobench_tools.physics import Vehicle

    flight = made_flight("made")
    windows, _ = cut_windows(flight, SPANS, "onboard", past=True)
    nuisances = nuisances_of(adapt)
    made = GreyBoxPredictor("made", {**terms_of(nuisances), **TERMS}, Vehicle(), adapt, scale=np.ones((8, 4)),
                            nuisances_=nuisances)
    wide = made.features(windows).matrix().shape[1] + 1
    made = replace(made, gains=1e-4 * np.random.default_rng(0).normal(size=(len(nuisances), wide)))
    together = made.predict(windows)
    for i in (0, 1, 7, WINDOW, len(windows) - 1):
        alone = made.predict(array_fields.rows(windows, slice(i, i + 1)))
        np.testing.assert_allclose(alone.position_m[0], together.position_m[i], atol=1e-9)
        np.testing.assert_allclose(alone.rate_rad_s[0], together.rate_rad_s[i], atol=1e-7)
    start_s = flight["mocap"].time_s[300 + 10 * WINDOW]
    again, _ = cut_windows(spoiled(flight, start_s), SPANS, "onboard", past=True)
    alone = made.predict(array_fields.rows(again, slice(WINDOW, WINDOW + 1)))
    np.testing.assert_allclose(alone.rate_rad_s[0], together.rate_rad_s[WINDOW], atol=1e-7)


def test_useless_flights_are_one_line():
    from identification.greybox.fit_windows import cut, gather
    from nanobench_tools.errors import InputError

    flight = made_flight("made")
    still = replace(flight.streams["motor"], values=np.full_like(flight["motor"].values, 0.7))
    constant = replace(flight, streams={**flight.streams, "motor": still})
    for case, said in ((Case(constant, SPANS, ("all",)), "never changes"),
                       (Case(flight, (), ("all",)), "half a second of clean flight")):
        with pytest.raises(InputError, match=said) as error:
            gather(cut([case]))
        assert "\n" not in str(error.value)
