"""Logs of a made vehicle, flown once, and the study of them."""

import pytest
from made_logs import MASS, flight, fly

from identification.motors import identify, rotation


@pytest.fixture(scope="session")
def logs():
    return fly(3, noise=3.0)


@pytest.fixture(scope="session")
def few_inputs():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rotation, "INPUTS", tuple(k for k in rotation.INPUTS if k.name in ("radio", "logged", "rpm")))
        patch.setattr(rotation, "MOST_WINDOWS", 60)
        yield


@pytest.fixture(scope="session")
def reported():
    """What the study reports as progress: (done, of how many)."""
    return []


@pytest.fixture(scope="session")
def study(logs, few_inputs, reported):
    return identify([flight(log, f"made{i}") for i, log in enumerate(logs)], mass_kg=MASS,
                    progress=lambda *step: reported.append(step))
