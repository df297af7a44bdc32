"""Made flights for learned models. These tests run in a process of their own (``make learned`` does so): after JAX has
mapped its memory, LLVM may abort when a compiled model is loaded (code and data land more than 2 GB apart)."""

import os

import pytest

from identification.learned.libraries import one_thread
from nanobench_tools.flight import Span
from nanobench_tools.protocols.task1 import Case

OWN_PROCESS = "NANOBENCH_TEST_LEARNED"

if os.environ.get(OWN_PROCESS):
    one_thread()  # as in processes that train side by side
else:
    collect_ignore_glob = ["test_*.py"]


@pytest.fixture(scope="session")
def flights(crowd):
    """Practice flights: a circle, a trefoil, a helix (SYNTHETIC)."""
    return [crowd.flight(name) for name in ("short circle", "short trefoil", "helix")]


@pytest.fixture(scope="session")
def cases(flights):
    """The same without an audit: from 4 s until 2 s before the end of the path."""
    return [Case(flight, (Span(4.0, 10.0),), ("all",)) for flight in flights]
