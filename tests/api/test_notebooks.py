"""The notebooks run from top to bottom, on SYNTHETIC flights and on real ones."""

import os
import runpy
import shutil
from pathlib import Path

import pytest

NOTEBOOKS = Path(__file__).parents[2] / "notebooks"
RECORDINGS = 3
"""Of real ones, each with its sheet."""
NAMES = ("my_log", "my_estimator", "my_vehicle", "my_simulator")


def test_all_are_run_here():
    assert {path.stem for path in NOTEBOOKS.glob("*.py")} == set(NAMES)


def cells(name, monkeypatch, place=None):
    monkeypatch.delenv("NANOBENCH_NOTEBOOK_DATA", raising=False)
    if place is not None:
        monkeypatch.setitem(os.environ, "NANOBENCH_NOTEBOOK_DATA", str(place))
    return runpy.run_path(str(NOTEBOOKS / f"{name}.py"))


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES[:2])
def test_short_ones(name, monkeypatch):
    assert cells(name, monkeypatch)["flights"][0].provenance.synthetic


@pytest.mark.slow
def test_my_vehicle(monkeypatch):
    found = cells("my_vehicle", monkeypatch)
    model = found["model"]
    assert model.score(found["test"]).loc[(model.predictor.name, "position_mae_m"), "50"] < 0.2


@pytest.mark.slow
def test_my_simulator_is_told_that_it_is_too_heavy(monkeypatch):
    found = cells("my_simulator", monkeypatch)["found"]
    assert found.outcome == "named"
    assert found.improvement.loc[(50, "position_m"), "after"] < found.improvement.loc[(50, "position_m"), "before"]


@pytest.mark.slow
@pytest.mark.real
@pytest.mark.parametrize("name", NAMES[:2])
def test_on_real_recordings(name, real_data, tmp_path, monkeypatch):
    for path in sorted((real_data / "nanobench" / "datasets" / "dataset").glob("B2_circle_*"))[:2 * RECORDINGS]:
        shutil.copy(path, tmp_path)
    assert not cells(name, monkeypatch, tmp_path)["flights"][0].provenance.synthetic
