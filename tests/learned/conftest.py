"""Made flights for learned models. These tests run in a process of their own (``make learned`` does so): after JAX has
mapped its memory, LLVM may abort when a compiled model is loaded (code and data land more than 2 GB apart)."""

import os

import pytest

from identification.learned.libraries import ONE_THREAD, one_thread
from nanobench_tools.flight import Span
from nanobench_tools.protocols.task1 import Case

OWN_PROCESS = "NANOBENCH_TEST_LEARNED"

if os.environ.get(OWN_PROCESS):
    # These networks compute for less time than LLVM optimises.
    os.environ.setdefault("XLA_FLAGS", f"{ONE_THREAD} --xla_backend_optimization_level=0")
    one_thread()  # as in processes that train side by side
else:
    collect_ignore_glob = ["test_*.py"]


@pytest.fixture(scope="session", autouse=True)
def compiled_by_jax(tmp_path_factory):
    """Each training is a function of its own: what equals one of an earlier training is not compiled again."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("JAX_COMPILATION_CACHE_DIR", str(tmp_path_factory.mktemp("jax")))
        patch.setenv("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")
        yield


@pytest.fixture(scope="session")
def flights(crowd):
    """Practice flights: a circle, a trefoil, a helix (SYNTHETIC)."""
    return [crowd.flight(name) for name in ("short circle", "short trefoil", "helix")]


@pytest.fixture(scope="session")
def cases(flights):
    """The same without an audit: from 4 s until 2 s before the end of the path."""
    return [Case(flight, (Span(4.0, 10.0),), ("all",)) for flight in flights]
