"""TinyMPC against our linear program: the same steady program about hover, from the same starts.

    python benchmarks/speed/tinympc_speed.py [--python OTHER] [--starts 500]

SYNTHETIC. TinyMPC takes one A, B and diagonal costs. It needs numpy 1 and runs in a separate interpreter: OTHER, or
that of ``.venv-tinympc``. The first run makes the latter (pip compiles TinyMPC in two minutes).

The program has 12 states, 4 thrusts, N = 20, and thrusts bounded as on a battery of 3.5 V. Starts are drawn so that
about half meet a bound. Both have the program set up, or condensed, before the clock starts; timed is from a new start
to the thrusts. ``mpc_daqp`` does more in a command: it linearises along a moving target, condenses, observes and maps
to PWM (``mpc_speed.py``).
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from kept import show
from scipy.linalg import solve_discrete_are

from controllers.mpc import prediction_model
from controllers.mpc.dense_qp import Daqp
from controllers.mpc.linear_mpc import MpcDaqp

OWN = Path(__file__).parents[2] / ".venv-tinympc"
PACKAGES = ("numpy<2", "scipy==1.11.4", "tinympc==0.0.8")
HORIZON, VOLTAGE = 20, 3.5
PENALTIES = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0)
"""Of TinyMPC's splitting: small ones answer better and later."""
NEAR_MN = 1.0
"""A hundredth of the thrust of a motor in hover."""
UNIT_N = 0.01
"""Thrusts are counted in these, so that costs of states and inputs are of one size."""

DRIVER = """
import json, sys, time
import numpy as np, tinympc
d = np.load(sys.argv[1])
found = {}
for rho in d["penalties"]:
    s = tinympc.TinyMPC()
    n = d["a"].shape[0]
    s.setup(d["a"], d["b"], np.diag(d["q"]), np.diag(d["r"]), int(d["horizon"]) + 1, rho=float(rho),
            x_min=np.full(n, -1e17), x_max=np.full(n, 1e17), u_min=d["low"], u_max=d["high"],
            abs_pri_tol=float(d["tolerance"]), abs_dua_tol=float(d["tolerance"]), max_iter=500)
    spent, first = [], []
    for x in d["starts"]:
        began = time.perf_counter()
        s.set_x0(x)
        u = s.solve()["controls"]
        spent.append(time.perf_counter() - began)
        first.append(np.array(u, float).ravel()[:4].tolist())
    found[str(float(rho))] = {"spent": spent, "first": first}
json.dump(found, open(sys.argv[2], "w"))
"""


def program() -> dict[str, np.ndarray]:
    """a, b, q, r, p, low, high about hover; inputs in UNIT_N."""
    controller = MpcDaqp(prediction_model.practice_model(), states=prediction_model.RIGID)
    a, b = controller.hover_stage()
    low, high = controller.thrust_map.limits(np.full(1, VOLTAGE))
    b, q, r = UNIT_N * b, controller.q[:len(a)], UNIT_N**2 * np.diag(controller.r)
    bounds = [(np.broadcast_to(np.ravel(x), 4) - controller.hover_N) / UNIT_N for x in (low[0], high[0])]
    return {"a": a, "b": b, "q": q, "r": r, "p": solve_discrete_are(a, b, np.diag(q), np.diag(r)), "low": bounds[0],
            "high": bounds[1]}


def dense(given: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """h (4 N, 4 N) and f (4 N, S) of the program in its inputs: min z'hz/2 + (f x)'z."""
    a, b, s = given["a"], given["b"], len(given["a"])
    powers = [np.eye(s)]
    for _ in range(HORIZON):
        powers.append(a @ powers[-1])
    reach, free = np.zeros((HORIZON * s, HORIZON * 4)), np.vstack(powers[1:])
    for k in range(HORIZON):
        for j in range(k + 1):
            reach[k * s:(k + 1) * s, 4 * j:4 * j + 4] = powers[k - j] @ b
    cost = np.kron(np.eye(HORIZON), np.diag(given["q"]))
    cost[-s:, -s:] = given["p"]
    return reach.T @ cost @ reach + np.kron(np.eye(HORIZON), np.diag(given["r"])), reach.T @ cost @ free


def interpreter() -> Path:
    """An interpreter with TinyMPC, made if missing."""
    python = OWN / "bin" / "python"
    if not (OWN / ".installed").exists():
        venv.create(OWN, clear=True, with_pip=True)
        subprocess.run([str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *PACKAGES],
                       check=True)
        (OWN / ".installed").touch()
    return python


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--python", type=Path, help="interpreter that has tinympc; default: one is made")
    parser.add_argument("--starts", type=int, default=500)
    parser.add_argument("--tolerance", type=float, default=1e-4, help="of TinyMPC's residuals; its own default is 1e-3")
    asked = parser.parse_args()
    try:
        python = asked.python or interpreter()
        subprocess.run([str(python), "-c", "import tinympc"], capture_output=True, check=True)
    except (OSError, subprocess.CalledProcessError) as error:
        sys.exit(f"no interpreter with tinympc, give one as --python: {error}")
    given, rng = program(), np.random.default_rng(0)
    sizes = np.repeat([0.15, 0.3, 0.1, 1.0], 3)
    starts = rng.standard_normal((asked.starts, 12)) * sizes * rng.uniform(0.1, 1.5, (asked.starts, 1))
    h, f = dense(given)
    low, high = np.tile(given["low"], HORIZON), np.tile(given["high"], HORIZON)
    solver, mine, exact, bound = Daqp(), [], [], 0
    for x in starts:
        began = time.perf_counter()
        z = solver(h, f @ x, low, high)
        mine.append(time.perf_counter() - began)
        exact.append(z[:4])
        bound += bool(np.any((z < low + 1e-6) | (z > high - 1e-6)))
    with tempfile.TemporaryDirectory() as folder:
        task, answer = Path(folder) / "task.npz", Path(folder) / "answer.json"
        np.savez(task, **{k: v for k, v in given.items() if k != "p"}, horizon=HORIZON, starts=starts,
                 penalties=PENALTIES, tolerance=asked.tolerance)
        run = [str(python), "-c", DRIVER, str(task), str(answer)]
        subprocess.run(run, check=True, stdout=subprocess.DEVNULL)
        found = json.loads(answer.read_text(encoding="utf-8"))
    ours = 1e3 * np.array(mine)
    print(f"SYNTHETIC, n = {len(starts)} starts, {bound} with a thrust at its bound; 12 states, 4 inputs, "
          f"N = {HORIZON}; tolerance {asked.tolerance:g}")
    print(f"DAQP, condensed: median {np.median(ours):.3f} ms, p99 {np.quantile(ours, 0.99):.3f}; exact")
    near = []
    for penalty, one in found.items():
        theirs = 1e3 * np.array(one["spent"])
        off = 1e3 * UNIT_N * np.abs(np.array(one["first"]) - np.array(exact)).max(axis=1)
        near += [float(np.median(theirs))] if np.median(off) < NEAR_MN else []
        print(f"TinyMPC, penalty {penalty:>7}: median {np.median(theirs):.3f} ms, p99 {np.quantile(theirs, 0.99):.3f}; "
              f"first thrusts off by {np.median(off):.2f} mN (median), {off.max():.1f} (most)")
    if near:
        print(f"ratio of medians, TinyMPC at its fastest within {NEAR_MN:g} mN over DAQP: "
              f"{min(near) / np.median(ours):.1f}")
        show("TinyMPC / DAQP, condensed", min(near) / np.median(ours), len(starts))
    else:
        print(f"TinyMPC came within {NEAR_MN:g} mN (median) at no penalty")


if __name__ == "__main__":
    main()
