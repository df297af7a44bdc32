"""Fixtures of the diagnosis' tests."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from carried_tracks import MODEL, wrench_of


@pytest.fixture(scope="session")
def model():
    return MODEL


@pytest.fixture(scope="session")
def plain():
    """Three flights of MODEL."""
    return wrench_of(MODEL)
