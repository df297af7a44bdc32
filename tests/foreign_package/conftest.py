"""The foreign package, put in place once for every test of it."""

import pytest
from foreign_install import placed


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    return placed(tmp_path_factory.mktemp("installed"))
