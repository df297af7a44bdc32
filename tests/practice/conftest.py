"""Four short practice flights, flown once for all tests of this folder."""

import pytest

from nanobench_tools.practice import practice_flights


@pytest.fixture(scope="session")
def practice(made_once):
    """circle and trefoil behind pid, the same behind mellinger; 4 s of path each. Seed 9 deals the controllers so."""
    return made_once("practice", lambda: practice_flights(4, seed=9, families=("circle", "trefoil"), speeds=("fast",),
                                                          duration_s=4.0))
