"""The files of the three SYNTHETIC flights that are installed with the package."""

from pathlib import Path

SAMPLE = Path(__file__).resolve().parents[1] / "sample"
"""Recordings and their sheets, written by ``python -m tools.sample_flights``."""


def sample_files() -> list[Path]:
    """Return the paths of the recordings and their sheets, sorted by name."""
    return sorted(SAMPLE.glob("sample_*"))
