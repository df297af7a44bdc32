"""NEES by hand, and its band on errors that really have the stated covariance."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from nanobench_tools.metrics.consistency import consistency, normalised_squared

HAND = tomllib.loads((Path(__file__).parents[1] / "references" / "metrics_by_hand.toml").read_text())["nees"]


def test_by_hand():
    errors = np.tile(HAND["error"], (2, 1))
    np.testing.assert_allclose(normalised_squared(errors, np.array(HAND["covariances"])), HAND["expected"], rtol=1e-12)


def draw(seed, n=200, scale=1.0):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(n, 3, 3)) + 3 * np.eye(3)
    return scale * (root @ rng.normal(size=(n, 3, 1)))[..., 0], root @ np.swapaxes(root, 1, 2)


def test_the_band_holds_as_often_as_it_says():
    verdicts = [consistency(*draw(seed)).verdict for seed in range(300)]
    share = verdicts.count("consistent") / 300
    assert share == pytest.approx(0.95, abs=0.04)  # 3 standard errors of a share of 300


@pytest.mark.parametrize(("scale", "verdict"), [(1.5, "overconfident"), (0.7, "underconfident")])
def test_wrong_covariances_are_seen(scale, verdict):
    found = consistency(*draw(1, scale=scale))
    assert found.verdict == verdict
    assert found.dimension == 3


def test_one_covariance_for_all_rows():
    error = np.random.default_rng(0).normal(size=(50, 2))
    np.testing.assert_allclose(normalised_squared(error, 4 * np.eye(2)), np.sum(error**2, axis=1) / 4)


@pytest.mark.parametrize("p", [np.zeros((2, 2)), -np.eye(2), np.eye(3)])
def test_bad_covariances_raise(p):
    with pytest.raises(ValueError, match=r"positive definite|do not fit"):
        normalised_squared(np.ones((4, 2)), p)


def test_no_errors_raise():
    with pytest.raises(ValueError, match="no errors"):
        consistency(np.empty((0, 2)), np.eye(2))
