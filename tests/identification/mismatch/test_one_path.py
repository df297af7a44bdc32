"""Whether a force of the place can be told from one of the motion there."""

from types import SimpleNamespace

import numpy as np

from identification.mismatch.leftover import _one_path


def _wrench(velocity):
    return SimpleNamespace(force_at=np.arange(len(velocity)), of=lambda field, at: velocity[at])


def test_a_path_that_is_always_flown_the_same_way_is_the_place_too():
    angle = np.linspace(0.0, 30.0, 600)
    place = np.stack([np.cos(angle), np.sin(angle), np.ones(600)], axis=1)
    along = np.stack([-np.sin(angle), np.cos(angle), 0.0 * angle], axis=1)
    assert _one_path(_wrench(along), place)
    there_and_back = along * np.where(angle > 15.0, -1.0, 1.0)[:, None]
    assert not _one_path(_wrench(there_and_back), place)
