"""Small files that public bug reports led to, outside of the repository; each folder has the right result beside it."""

from pathlib import Path

import pytest


@pytest.fixture
def reported(real_data) -> Path:
    """Folder of the reported inputs, one folder per case."""
    if not (real_data / "reports").is_dir():
        pytest.skip("REPORTED INPUTS ABSENT: no folder reports beside the recordings")
    return real_data / "reports"
