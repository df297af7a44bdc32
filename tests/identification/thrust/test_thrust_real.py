"""The public stand series: what holds on files that were not fitted."""

import numpy as np
import pytest

from identification.thrust.error_tables import same_propeller
from identification.thrust.thrust_rows import stand_rows
from identification.thrust.thrust_study import errors, study
from nanobench_tools.sources.discover import load_recordings

pytestmark = pytest.mark.real


@pytest.fixture(scope="module")
def rows(real_data):
    return stand_rows(load_recordings([real_data / "stand"]).flights)


def test_series_without_thrust_are_left_out_with_a_reason(rows):
    assert len(rows.files) == 3
    assert len(rows.reasons) == 3
    assert all("holds no thrust" in reason for reason in rows.reasons.values())


def test_better_than_the_firmware_on_every_series_of_the_same_propeller(rows):
    compared = 0
    for out in rows.files:
        others = [s for s in rows.files if s is not out and same_propeller(s, out)]
        if not others:
            continue
        found = study(others, 0.04, draws=0)
        rms = {n: float(np.sqrt(np.mean(errors(f, out) ** 2))) for n, f in found.fits.items() if f.values}
        assert rms[found.best] < min(rms["firmware_2_1_plus"], rms["firmware_legacy"]), out.name
        compared += 1
    assert compared == 2
