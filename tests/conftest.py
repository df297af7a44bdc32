"""Fixtures shared by all tests.

Real recordings are never in the repository; tests that need them say when they are absent.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parent.parent


def _real_root() -> Path | None:
    """The folder that holds nanobench/, crazyflie_usd/, ... ; $NANOBENCH_DATA may name it or its nanobench folder."""
    places = [os.environ.get("NANOBENCH_DATA"), REPOSITORY.parent / "shared" / "data"]
    for place in map(Path, filter(None, places)):
        for root in (place, place.parent):
            if (root / "nanobench").is_dir():
                return root
    return None


@pytest.fixture(scope="session")
def real_data() -> Path:
    """Root of the real recordings, with nanobench/, crazyflie_usd/, crazypad/, stand/, firmware_reference/ in it."""
    root = _real_root()
    if root is None:
        pytest.skip("REAL RECORDINGS ABSENT: set NANOBENCH_DATA to run this test")
    return root


def pytest_terminal_summary(terminalreporter) -> None:
    """Says at the end, and not only in a skip count, that nothing was checked on real recordings."""
    if _real_root() is None:
        terminalreporter.write_line("REAL RECORDINGS ABSENT: every test marked 'real' was skipped; set NANOBENCH_DATA")
