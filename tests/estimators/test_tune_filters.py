"""The search for the filters' noise: its objective against SciPy, its budget, where it stops."""

import importlib.util
import math
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from estimators import inertial_core
from nanobench_tools.lookup.registry import load
from nanobench_tools.methods import Estimate

FILE = Path(__file__).resolve().parents[2] / "benchmarks" / "studies" / "tune_filters.py"


@pytest.fixture(scope="module")
def tuning():
    spec = importlib.util.spec_from_file_location("tune_filters", FILE)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


class Known:
    """Says what it is told, with a covariance that grows."""

    def __init__(self, time_s, position_m, covariance):
        self.made = Estimate(time_s, position_m, np.tile([0.0, 0.0, 0.0, 1.0], (len(time_s), 1)),
                             np.zeros_like(position_m), covariance)

    def estimate(self, given):
        return self.made


def test_the_objective_is_the_density_of_the_true_position(tuning):
    rng = np.random.default_rng(5)
    time_s = np.arange(0.0, 3.0, 0.1)
    position = rng.normal(size=(30, 3))
    root = rng.normal(size=(30, 9, 9))
    covariance = root @ np.swapaxes(root, 1, 2) + np.eye(9)
    rows = [3, 17, 29]
    true = position[rows] + rng.normal(size=(3, 3))
    seen = tuning.Seen(None, time_s[rows] + 0.01, true)
    expected = [multivariate_normal(position[r], covariance[r, :3, :3]).logpdf(t)
                for r, t in zip(rows, true, strict=True)]
    assert tuning.log_density(Known(time_s, position, covariance), seen) == pytest.approx(np.mean(expected))
    far = tuning.Seen(None, time_s[rows], true + 1e6)
    assert tuning.log_density(Known(time_s, position, covariance), far) == tuning.WORST


def test_a_search_keeps_to_its_budget_and_finds_the_best(tuning, monkeypatch):
    """An objective that is known: best where one setting is twice its start and another 0.01 above nought."""
    def known(method, sessions):
        s = method.settings
        return -math.log(s["gyro_noise"] / 0.02) ** 2 - (100.0 * (s["drag_cross"] - 0.01)) ** 2 - sessions

    monkeypatch.setattr(tuning, "objective", known)
    start = {"gyro_noise": 0.01, "drag_cross": 0.0, "drag": 0.0}
    method = SimpleNamespace(settings=start)
    search = tuning.Search(method, start, 0.0, 60).run()
    assert search.tried <= 60
    assert search.steps[0] == (1, start)
    assert search.after(1) == start
    found = search.after(60)
    assert found["gyro_noise"] == pytest.approx(0.02, rel=0.02)
    assert found["drag_cross"] == pytest.approx(0.01, abs=1e-3)
    assert found["drag"] == 0.0  # a row without drag gets none
    assert tuning.Search(method, start, 0.0, 5).run().tried == 5


def test_it_stops_where_sessions_held_out_are_likeliest(tuning, monkeypatch):
    """Three sessions that ask for other values: going all the way to what two of them want is worse for the third."""
    def known(method, sessions):
        return float(np.mean([-(math.log(method.settings["drag"]) - session) ** 2 for session in sessions]))

    monkeypatch.setattr(tuning, "objective", known)
    agreed, curve, _ = tuning.searched(SimpleNamespace(), {"drag": 1.0}, [0.5, 0.5, 0.5], 40)
    assert math.log(agreed["drag"]) == pytest.approx(0.5, abs=0.01)
    assert max(value for _, value in curve) == pytest.approx(0.0, abs=1e-3)
    torn, _, stop = tuning.searched(SimpleNamespace(), {"drag": 1.0}, [1.0, -1.0, 0.0], 40)
    assert stop == 1
    assert torn == {"drag": 1.0}


def test_every_row_that_is_searched_has_settings_of_the_core_and_a_start(tuning):
    for name in tuning.ROWS:
        row = load("estimators", name)()
        assert set(row.settings) <= set(inertial_core.NAMES), name
        assert set(row.settings) <= set(tuning.START), name
        assert all(np.isfinite(value) for value in row.settings.values())
    assert load("estimators", "strapdown")().settings["drag"] == 0.0
