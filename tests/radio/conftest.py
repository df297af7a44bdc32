"""What tests against the unmodified cflib share."""

import warnings

import pytest


@pytest.fixture(scope="module")
def cflib_drivers():
    """cflib's drivers, whose start warns of radios that are not there."""
    import cflib.crtp

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        cflib.crtp.init_drivers()
        yield
