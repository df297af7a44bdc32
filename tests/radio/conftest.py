"""What tests against the unmodified cflib share."""

import warnings

import pytest

from nanobench_tools.radio.fly import flight_plan


@pytest.fixture(scope="module")
def cflib_drivers():
    """cflib's drivers, whose start warns of radios that are not there."""
    import cflib.crtp

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        cflib.crtp.init_drivers()
        yield


@pytest.fixture
def short_phases(monkeypatch):
    """The path begins after 4.3 s, not after 6, and is flown at full speed from 4.8 s on."""
    monkeypatch.setattr(flight_plan, "HOVER_S", 0.3)
    monkeypatch.setattr(flight_plan, "FADE_S", 0.5)
