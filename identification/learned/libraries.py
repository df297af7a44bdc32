"""JAX and its dependents, loaded once and only when something is trained or predicted."""

import functools
import os
import sys
from types import SimpleNamespace
from typing import Any

from nanobench_tools.errors import MissingExtraError

Array = Any
"""An array, or a tree of arrays, of JAX, which is loaded late."""
ONE_THREAD = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"


def share_process() -> None:
    """Lets Numba and JAX live in one process. JAX maps so much memory that code which Numba loads afterwards may land
    more than 2 GB from its data, at which LLVM aborts. The memory manager of llvmlite keeps code and data together.
    Has to be called before Numba compiles or loads anything."""
    os.environ.setdefault("NUMBA_USE_LLVMLITE_MEMORY_MANAGER", "1")
    if "numba" in sys.modules:
        sys.modules["numba"].core.config.USE_LLVMLITE_MEMORY_MANAGER = True


def one_thread() -> None:
    """Has XLA compute on one thread: on a CPU the networks are too small to gain from more, and items run in parallel.
    The last digit depends on the number. Has to be called before JAX is loaded; what the environment says stays."""
    os.environ.setdefault("XLA_FLAGS", ONE_THREAD)
    os.environ.setdefault("NPROC", "1")  # how many threads XLA's pool has; no flag sets it


@functools.cache
def libraries() -> SimpleNamespace:
    """{jax, jnp, lax, eqx, optax, safetensors}. MissingExtraError, one line that says what to install, without them.

    JAX takes an accelerator when it sees one. On a CPU it is held to one thread, unless XLA_FLAGS and NPROC say
    otherwise or JAX was loaded before.
    """
    share_process()
    if "jax" not in sys.modules:
        one_thread()
        os.environ.setdefault("JAX_PLATFORMS", "")
    try:
        import equinox
        import jax
        import optax
        import safetensors.numpy
    except ImportError as error:
        raise MissingExtraError((error.name or "jax").partition(".")[0], "learned") from error
    return SimpleNamespace(jax=jax, jnp=jax.numpy, lax=jax.lax, eqx=equinox, optax=optax, safetensors=safetensors.numpy)


def platform() -> str:
    """What JAX computes on, such as "cpu"."""
    return str(libraries().jax.devices()[0].platform)
