"""Our compiled rollouts against Numba over generated Python source and JAX, for a whole fit and a whole plant run.

    python benchmarks/speed/compiled_rollout.py [--data DIR] [--sizes small full] [--repeats N] [--jax]

The same functions three ways:

- the instructions of the CasADi function as LLVM code (``nanobench_tools.physics``);
- as Python source, a line a value, that Numba compiles, the inner loop over eight windows;
- the model's equations in JAX, ``jvp`` and ``vmap`` over directions and windows and ``scan`` over rows, in double
  precision.

The fit is the full model of ``nanobench sysid`` until convergence, small and full. Small uses every twelfth window,
full every third, as in ``fit_speed``. The plant is that of Task 2 behind the firmware's compiled controllers, a second
of 32 and of 512 vehicles. Cold: no function is compiled, neither in memory nor on disk; smallest size. Warm: every
function is compiled, as with a full disk cache. Both have a requirement (``REQUIRED_RATIO``). Medians of N runs that
take turns, one thread, and times over ours. Processor time, which other work on the machine hardly lengthens. JAX, the
slower peer, takes a minute to compile: only with ``--jax``. Without recordings, practice flights (SYNTHETIC).
"""

from __future__ import annotations

import argparse
import functools
import math
import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest import mock

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1")

import casadi as ca
import numba as nb
import numpy as np
from fit_speed import FLIGHTS, problem_of
from kept import WORSE, show
from plant_speed import chain

from identification.greybox import sensitivity
from identification.greybox.fit_windows import cases_of, cut, gather
from identification.greybox.solve import solve, usual_errors
from nanobench_tools.auditing.selection import distinct
from nanobench_tools.physics import batched, machine, rollout
from nanobench_tools.physics.equations import Equations
from nanobench_tools.physics.inputs import substeps
from nanobench_tools.physics.lanes import Kernel
from nanobench_tools.physics.ops import Ops
from nanobench_tools.practice.flights import write_practice
from nanobench_tools.sources.discover import default_data, load_recordings

REQUIRED_RATIO = {"cold": 2.0, "warm": WORSE}
"""Least time of either peer over ours, for a whole fit and a whole plant run: the rule of ARCHITECTURE.md."""
LANES = batched.LANES
SIZES = {"small": (12, 32), "full": (3, 512)}
"""Every so many windows, and vehicles."""
OURS, NUMBA, JAX = "LLVM", "Numba", "JAX"

BINARY = {"add": "+", "sub": "-", "mul": "*", "div": "/", "lt": "<", "le": "<=", "eq": "==", "ne": "!="}
UNARY = {"neg": "-{0}", "sq": "{0} * {0}", "twice": "{0} + {0}", "inv": "1.0 / {0}", "not": "not {0}", "assign": "{0}",
         "if_else_zero": "where({0}, {1})", "fabs": "abs({0})", "fmin": "least({0}, {1})", "fmax": "most({0}, {1})",
         **{name: f"{name}({{0}})" for name in ("sqrt", "exp", "sin", "cos")}}


@nb.njit
def where(condition, value):
    return value if condition else 0.0


@nb.njit
def least(a, b):
    return a if a < b or a != a else b


@nb.njit
def most(a, b):
    return a if a > b or a != a else b


def source(function, roles: list[str]) -> tuple[str, int, int]:
    """Python source of f(state, ...) -> next state. ``uniform(uniform inputs, out)`` computes what depends on these
    alone, and ``lanes(given, w)`` the rest for LANES windows in the flat w. Values it takes from uniform, components
    of w."""
    names = {getattr(ca, name): name[3:].lower() for name in dir(ca) if name.startswith("OP_")}
    begins = np.cumsum([0] + [0 if role == "uniform" else function.numel_in(i) for i, role in enumerate(roles)])
    work: dict[int, str] = {}
    uniform: dict[str, bool] = {}
    head, body, shared = [], [], {}

    def inside(name: str) -> str:
        """A value as it is called in the loop over windows."""
        if not uniform.get(name, True):
            return name
        if name.startswith("v"):
            return shared.setdefault(name, f"u{len(shared)}")
        return name

    for k in range(function.n_instructions()):
        operation = names[function.instruction_id(k)]
        given, out = function.instruction_input(k), function.instruction_output(k)
        if operation == "output":
            body.append(f"w[{(begins[-1] + out[1]) * LANES} + i] = {inside(work[given[0]])}")
            continue
        if operation == "const":
            work[out[0]] = f"({float(function.instruction_constant(k))!r})"
            continue
        name = f"v{k}"
        if operation == "input":
            alone = roles[given[0]] == "uniform"
            text = f"in{given[0]}[{given[1]}]" if alone else f"w[{(begins[given[0]] + given[1]) * LANES} + i]"
        else:
            of = [work[i] for i in given]
            alone = all(uniform.get(x, True) for x in of)
            of = of if alone else [inside(x) for x in of]
            text = f"{of[0]} {BINARY[operation]} {of[1]}" if operation in BINARY else UNARY[operation].format(*of)
        (head if alone else body).append(f"{name} = {text}")
        uniform[name], work[out[0]] = alone, name
    arguments = [f"in{i}" for i, role in enumerate(roles) if role == "uniform"]
    return "\n".join([
        f"def uniform({', '.join([*arguments, 'out'])}):", *(f"    {line}" for line in head),
        *(f"    out[{i}] = {name}" for i, name in enumerate(shared)), "    return", "",
        "def lanes(given, w):", *(f"    u{i} = given[{i}]" for i in range(len(shared))),
        f"    for i in range({LANES}):", *(f"        {line}" for line in body), ""]), len(shared), int(
            begins[-1] + function.numel_out(0))


class NumbaSource(batched.Compiled):
    """f(state, row, lane or uniform inputs ...) -> next state in source that Numba compiles."""

    def __init__(self, function, roles: list[str]) -> None:
        self.kernel = Kernel("", tuple(roles), *(tuple(size(i) for i in range(count)) for size, count in (
            (function.size_in, function.n_in()), (function.size_out, function.n_out()))))
        self.names, self.threads = tuple(function.name_in(i) for i in range(function.n_in())), 1
        text, self._shared, self._size = source(function, roles)
        scope: dict = {"where": where, "least": least, "most": most,
                       **{name: getattr(math, name) for name in ("sqrt", "exp", "sin", "cos")}}
        exec(text, scope)
        like = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}}
        self._uniform, lanes = nb.njit(**like)(scope["uniform"]), nb.njit(**like)(scope["lanes"])

        @nb.njit(**like)
        def run(states, start, row, lane, given, w):
            every, size = int(len(states) > 1), states.shape[1]
            states[0] = start[0]
            places = (0, size, size + row.shape[1], size + row.shape[1] + lane.shape[1])
            for low in range(0, states.shape[2], LANES):
                copy(lane[0], w, places[2], low)
                for j in range(len(row)):
                    copy(states[j * every], w, places[0], low)
                    copy(row[j], w, places[1], low)
                    lanes(given, w)
                    for c in range(size):
                        for i in range(LANES):
                            states[(j + 1) * every, c, low + i] = w[(places[3] + c) * LANES + i]

        self._rows = run

    def _run(self, arrays: list[np.ndarray], wide: int, rows: int, stride: int) -> None:
        of = dict(zip(self.kernel.roles, arrays, strict=False))
        given = np.zeros(max(self._shared, 1))
        self._uniform(*[x for x, role in zip(arrays, self.kernel.roles, strict=False) if role == "uniform"], given)
        states = arrays[len(self.kernel.roles)]
        self._rows(states, arrays[0], of["row"], of.get("lane", np.zeros((1, 0, wide))), given,
                   np.zeros(self._size * LANES))


@nb.njit
def copy(there, w, place, low):
    for c in range(len(there)):
        for i in range(LANES):
            w[(place + c) * LANES + i] = there[c, low + i]


def numba_scan(function, rows: list[str], uniform: list[str] | tuple = ()) -> NumbaSource:
    function = function.expand() if not function.is_a("SXFunction") else function
    names = [function.name_in(i) for i in range(1, function.n_in())]
    return NumbaSource(function, ["state", *("row" if name in rows else "uniform" if name in uniform else "lane"
                                             for name in names)])


class InJax:
    """A jitted function behind the interface of ``batched.Compiled``."""

    def __init__(self, function: Callable) -> None:
        self._function = function

    def on_threads(self, threads: int) -> InJax:
        return self

    def __call__(self, *given: np.ndarray, keep: str = "all") -> tuple[np.ndarray]:
        return (np.asarray(self._function(*given, keep == "all")),)


def jax_compiled(key, name: str, row_hz: float, own_parameters: bool, block: int = 0) -> InJax:
    """``symbolic.NAME`` with ``block`` tangents, run over rows."""
    import jax
    import jax.numpy as jnp

    model = key.model
    ops = Ops(jnp.sqrt, jnp.exp, jnp.sin, jnp.cos, jnp.abs, jnp.minimum, jnp.maximum, jnp.where)

    def plain(x, u, p):
        equations = Equations(model, list(p), ops, 1.0 / row_hz)
        given = list(x), list(u)
        found = equations.step(*given, substeps(model, row_hz)) if name == "step" else equations.lagged(*given)
        return jnp.stack([jnp.asarray(v, float) for v in found])

    def one(x, u, p, d):  # x (1 + block, S): the state and its tangents
        if not block:
            return plain(x[0], u, p)[None]
        y, ahead = jax.vmap(lambda s, e: jax.jvp(lambda a, b: plain(a, u, b), (x[0], p), (s, e)),
                            out_axes=(None, 0))(x[1:], d.T)
        return jnp.concatenate([y[None], ahead])

    windows = jax.vmap(one, in_axes=(2, 1, 1 if own_parameters else None, None), out_axes=2)

    def run(state, u, p, d, whole):
        def row(x, now):
            after = windows(x, now, p, d)
            return after, after if whole else None

        first = state.reshape(1 + block, -1, state.shape[1])
        last, rows = jax.lax.scan(row, first, u)
        return (jnp.concatenate([first[None], rows]).reshape(-1, *state.shape) if whole
                else last.reshape(state.shape))

    made = jax.jit(run, static_argnums=4)
    if block:
        return InJax(lambda state, u, p, d, whole: made(state, u, p, np.reshape(d, (-1, block)), whole))
    return InJax(lambda state, u, p, whole: made(state, u, p, 0.0, whole))


class Way:
    """One of the three: what makes compiled steps and tangents, and keeps them until ``forget``."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.forget()

    def forget(self) -> None:
        """Nothing is compiled any more."""
        steps, tangents = rollout._compiled.__wrapped__, sensitivity._tangent.__wrapped__
        if self.name == JAX:
            import jax

            jax.clear_caches()
            steps, tangents = jax_compiled, functools.partial(jax_compiled, block=sensitivity.BLOCK)
        machine.load.cache_clear()
        self._steps, self._tangents = (functools.lru_cache(maxsize=64)(make) for make in (steps, tangents))

    def time(self, work: Callable[[], object]) -> float:
        """Processor seconds of ``work`` this way."""
        made = numba_scan if self.name == NUMBA else batched.scan
        with (mock.patch.object(rollout, "_compiled", self._steps), mock.patch.object(rollout, "scan", made),
              mock.patch.object(sensitivity, "_tangent", self._tangents), mock.patch.object(sensitivity, "scan", made)):
            before = time.process_time()
            work()
            return time.process_time() - before


def fits(places: list[Path], sizes: list[str]) -> tuple[dict[str, Callable], str]:
    """Fits by size, and which recordings they are of."""
    with tempfile.TemporaryDirectory() as folder:
        if not places:
            write_practice(Path(folder), FLIGHTS, 0)
            places = [Path(folder)]
        flights = distinct(load_recordings(places).flights)[0]
    cases = cases_of([f for f in flights if "motor" in f][:2 * FLIGHTS])[:FLIGHTS]
    data = gather(cut(cases))
    problems = {size: problem_of(data.rows(slice(None, None, every))) for size, (every, _) in SIZES.items()
                if size in sizes}
    largest = problems[sizes[-1]]
    scale = usual_errors(largest, largest.model.values, np.zeros((len(data.names), 0)))
    word = "SYNTHETIC" if any(f.provenance.synthetic for f in flights) else "real"
    said = f"{len(cases)} {word} flights, " + ", ".join(f"{size} {len(p.data)} windows" for size, p in problems.items())
    return {size: functools.partial(solve, problem, scale) for size, problem in problems.items()}, said


def _keep(work: Callable[[], Any], results: list[Any]) -> None:
    results.append(work())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, nargs="*")
    parser.add_argument("--sizes", nargs="+", choices=list(SIZES), default=list(SIZES))
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--jax", action="store_true", help="measure JAX, too")
    options = parser.parse_args()
    names = [OURS, NUMBA]
    if options.jax:
        import jax

        jax.config.update("jax_enable_x64", True)
        names.append(JAX)
    work, said = fits(list(options.data or default_data()), options.sizes)
    jobs = {f"fit, {size}": job for size, job in work.items()}
    jobs |= {f"plant, {n} vehicles": functools.partial(chain, n, 100) for _, n in map(SIZES.get, options.sizes)}
    ways = [Way(name) for name in names]
    cold = list(jobs)[::len(options.sizes)]  # a fit and a plant run: they share no compiled function
    taken: dict[str, dict[str, list[float]]] = {}

    def timed(name: str, way: Way, state: str) -> None:
        taken.setdefault(f"{state}: {name}", {}).setdefault(way.name, []).append(way.time(jobs[name]))

    for name in cold:  # what all ways share, as the firmware's controllers, is compiled before
        ways[0].time(jobs[name])
    for _ in range(options.repeats):
        for way in ways:
            way.forget()
            with tempfile.TemporaryDirectory() as empty, mock.patch.dict(os.environ, {"NANOBENCH_CACHE": empty}):
                for name in cold:
                    timed(name, way, "cold")
    for way in ways:  # the fits agree, and the other sizes are compiled
        for name in [name for name in jobs if name not in cold]:
            way.time(jobs[name])
        fits_of: list[Any] = []
        way.time(functools.partial(_keep, work[options.sizes[0]], fits_of))
        print(f"{way.name}: {options.sizes[0]} fit, {fits_of[0].steps} steps, cost {fits_of[0].cost:.6f}", flush=True)
    for _ in range(options.repeats):
        for name in jobs:
            for way in ways:
                timed(name, way, "warm")
    medians = {name: {way: float(np.median(s)) for way, s in times.items()} for name, times in taken.items()}
    print(f"{said}; medians of {options.repeats} [s], and times over {OURS}'s")
    for name, times in medians.items():
        print(f"  {name:26}" + "  ".join(f"{way} {s:7.3f} ({s / times[OURS]:5.2f})" for way, s in times.items()))
        for way in names[1:]:
            show(f"{way} / ours, {name}", times[way] / times[OURS], options.repeats,
                 REQUIRED_RATIO[name.partition(":")[0]])


if __name__ == "__main__":
    main()
