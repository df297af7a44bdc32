"""Fixtures of all tests of identification."""

import pytest

from nanobench_tools.physics import machine


@pytest.fixture(autouse=True, scope="module")
def compiled_without_optimisation():
    """Compile models in a tenth of the time: here each kernel runs over few windows. The equations are the same."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(machine, "effort", lambda text: 0)
        yield
