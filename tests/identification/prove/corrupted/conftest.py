"""A group of flights that a model carries, without files."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "mismatch"))

from carried_tracks import MODEL, track_of

from identification.mismatch.recordings import Recordings
from identification.prove.corrupted.groups import Group
from nanobench_tools.flight import Flight, Provenance


@pytest.fixture(scope="session")
def nominal():
    """Further terms beside those of MODEL, small enough to fit its flights."""
    return MODEL.with_term("drag_torque", c=-3e-4).with_term("com_offset", r_m=(1e-3, 0.0, 0.0)).with_term(
        "motor_imbalance", g=(1.05, 0.95, 1.02, 0.98)).with_term("command_delay", delay_s=0.02).with_term(
        "angular_damping", d_r=(1e-4, 1e-4, 0.0))


@pytest.fixture(scope="session")
def tracks():
    """Two flights of 8 s of MODEL."""
    return tuple(track_of(MODEL, 20 + k, k, seconds=8.0) for k in range(2))


@pytest.fixture(scope="session")
def group(nominal, tracks):
    """They are of a vehicle that is nearly the nominal one."""
    flights = tuple(Flight(t.name, {}, {}, Provenance(f"{t.name}.csv", f"{k:064d}", "test")) for k, t in
                    enumerate(tracks))
    return Group("made_up", 0, Recordings(flights, {}, tracks, (), {}), nominal, "a key of its own")


@pytest.fixture
def own_cache(tmp_path, monkeypatch):
    """Nothing is kept from other tests."""
    monkeypatch.setenv("NANOBENCH_CACHE", str(tmp_path / "cache"))
