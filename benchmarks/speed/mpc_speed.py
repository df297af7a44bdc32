"""Time of predictive controllers from a measurement to the command, everything included; do-mpc for comparison.

    python benchmarks/speed/mpc_speed.py [--steps 2000] [--referee 40] [--json FILE]

A SYNTHETIC vehicle is flown round a fast figure of eight. Every command is timed on the wall clock and on that of the
thread, which runs only while the thread does. On a machine with other work the first is longer. Horizons are 20 steps
of 25 ms. do-mpc (IPOPT) gets the same problem as nmpc: equations, targets, weights, bounds, from the same starts.
"""

import argparse
import importlib.util
import os
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from kept import show

from controllers.mpc import prediction_model
from controllers.mpc.condense import headed
from controllers.mpc.disturbance import Tuning
from controllers.mpc.linear_mpc import MpcDaqp, MpcOsqp
from controllers.mpc.nmpc import Nmpc
from controllers.mpc.predictive_base import Mpc
from nanobench_tools.errors import how_to_install
from nanobench_tools.methods import Reference, VehicleState
from nanobench_tools.practice.references import path_spec
from nanobench_tools.practice.rigid_bodies import QUATERNION, RATE, THRUST, VELOCITY, Plant
from nanobench_tools.practice.vehicle_parameters import draw_vehicles
from nanobench_tools.results.result_files import write_json

PRACTICE = prediction_model.practice_model()
FRESH = Tuning(ages_s=(0.0, 0.0, 0.0, 0.0))
ROWS = {
    "mpc_daqp, 12 states": lambda: MpcDaqp(PRACTICE, tuning=FRESH, states=prediction_model.RIGID),
    "mpc_daqp, 12 + 4 rotors": lambda: MpcDaqp(PRACTICE, tuning=FRESH),
    "mpc_daqp, solved by OSQP": lambda: MpcDaqp(PRACTICE, tuning=FRESH, solver="osqp"),
    "mpc_osqp, 12 states": lambda: MpcOsqp(PRACTICE, tuning=FRESH, states=prediction_model.RIGID),
    "mpc_osqp, 12 + 4 rotors": lambda: MpcOsqp(PRACTICE, tuning=FRESH),
    "nmpc, 13 states": lambda: Nmpc(PRACTICE, tuning=FRESH, states=prediction_model.RIGID),
    "nmpc, 13 + 4 rotors": lambda: Nmpc(PRACTICE, tuning=FRESH),
}
WARM = 50
SPEC = path_spec("figure_eight", "fast")
PUSH_EVERY, PUSH_M_S = 100, 0.4
"""Every so many commands the vehicle is given a push, so that motors meet their limits."""


def now(t: float) -> Reference:
    def ahead(seconds: np.ndarray) -> Reference:
        r = SPEC.reference(t + seconds)
        return Reference(*(np.asarray(x)[:, None] for x in (r.position_m, r.yaw_rad, r.velocity_m_s,
                                                            r.acceleration_m_s2, r.jerk_m_s3, r.yaw_rate_rad_s)))

    r = SPEC.reference(np.array([t]))
    return Reference(r.position_m, r.yaw_rad, r.velocity_m_s, r.acceleration_m_s2, r.jerk_m_s3, r.yaw_rate_rad_s, ahead)


def flown(controller: Mpc, steps: int, each=None) -> np.ndarray:
    """Flies and gives (steps, 2) s of wall and thread per command; ``each(k, controller)`` is called after each."""
    rng = np.random.default_rng(0)
    plant = Plant(draw_vehicles([np.random.default_rng(0)], 0.0), np.zeros((1, 3)), np.zeros(1))
    first = now(0.0)
    plant.state[:3], plant.state[VELOCITY], plant.state[THRUST] = first.position_m.T, first.velocity_m_s.T, 0.1
    plant.ground_z[:] = -1e9
    controller.reset(1)
    spent = np.full((steps, 2), np.nan)  # written, so that its memory is taken now
    for k in range(steps):
        reference, s = now(controller.period_s * k), plant.state
        state = VehicleState(s[:3].T.copy(), s[VELOCITY].T.copy(), s[QUATERNION].T.copy(), s[RATE].T.copy(),
                             np.full(1, 3.5))
        wall, thread = time.perf_counter(), time.thread_time()
        command = controller.command(controller.period_s * k, state, reference)
        spent[k] = time.perf_counter() - wall, time.thread_time() - thread
        if each is not None:
            each(k, controller)
        plant.apply(command)
        plant.charge[:] = 0.5  # an endless battery
        for _ in range(round(controller.period_s / 0.002)):
            plant.step(0.002)
        if k % PUSH_EVERY == PUSH_EVERY - 1:
            plant.state[VELOCITY] += PUSH_M_S * rng.standard_normal((3, 1))
    return spent


def referee(controller: Nmpc):
    """do-mpc on the problem of ``controller``: function(x, targets, inputs, yaw, least, most) -> thrusts (N, 4)."""
    import casadi as ca
    import do_mpc

    model = do_mpc.model.Model("discrete", "SX")
    x, u = model.set_variable("_x", "x", (17, 1)), model.set_variable("_u", "u", (4, 1))
    target, goal = model.set_variable("_tvp", "target", (17, 1)), model.set_variable("_tvp", "goal", (4, 1))
    made = prediction_model.Equations4(controller.model)
    model.set_rhs("x", made.step(x, u, ca.SX.zeros(6), controller.dt_s))
    away, push = prediction_model.error(ca, x, target), u - goal
    model.set_expression("stage", 0.5 * (ca.sum1(ca.DM(controller.q) * away**2) + push.T @ ca.DM(controller.r) @ push))
    turned = np.empty_like(controller.p)
    headed(controller.p, 0.0, turned)
    model.set_expression("end", 0.5 * away.T @ ca.DM(turned) @ away)
    model.setup()
    mpc = do_mpc.controller.MPC(model)
    mpc.settings.n_horizon, mpc.settings.t_step, mpc.settings.store_full_solution = 20, controller.dt_s, False
    mpc.settings.supress_ipopt_output()
    mpc.set_objective(lterm=model.aux["stage"], mterm=model.aux["end"])
    mpc.set_rterm(u=0.0)
    limits = controller.thrust_map.limits(np.full(1, 3.5))
    mpc.bounds["lower", "_u", "u"], mpc.bounds["upper", "_u", "u"] = limits[0, 0], limits[1, 0]
    table = mpc.get_tvp_template()
    mpc.set_tvp_fun(lambda t: table)
    mpc.setup()
    mpc.x0 = np.concatenate([np.zeros(9), [1.0], np.zeros(3), np.full(4, 0.1)])
    mpc.u0 = np.full(4, 0.1)
    mpc.set_initial_guess()

    def solve(start: np.ndarray, targets: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        for k in range(21):
            table["_tvp", k, "target"], table["_tvp", k, "goal"] = targets[k], inputs[k]
        mpc.make_step(start)
        return np.array([np.array(mpc.opt_x_num["_u", k, 0]).ravel() for k in range(20)]) * 1.0

    return solve


def against_do_mpc(count: int) -> None:
    """Both on the same starts along a flight: time and answer."""
    controller = Nmpc(PRACTICE, tuning=FRESH)
    settled = Nmpc(PRACTICE, tuning=FRESH, iterations=10)
    quick = Nmpc(PRACTICE, tuning=FRESH)
    settled.reset(1)
    quick.reset(1)
    solve, inner, kept = referee(controller), controller.solve, []

    def keep(i, x, yaw, targets, inputs, least, most):
        kept[:] = [x.copy(), targets.copy(), inputs.copy(), least.copy(), most.copy(),
                   controller.plan.shifted(0, float(controller.plan.age_s[0]))]
        return inner(i, x, yaw, targets, inputs, least, most)

    controller.solve = keep  # type: ignore[method-assign]
    spent, gaps, one = [], [], []

    def each(k: int, flying: Mpc) -> None:
        if k < WARM or k % 7:
            return
        x, targets, inputs, least, most, before = kept
        settled.observer.disturbance[:] = 0.0
        settled.plan.thrust_N[0] = flying.plan.thrust_N[0]
        wall, thread = time.perf_counter(), time.thread_time()
        found = solve(x, targets, inputs)
        spent.append((time.perf_counter() - wall, time.thread_time() - thread))
        exact = settled.solve(0, x, 0.0, targets, inputs, least, most)
        gaps.append(np.abs(found - exact).max())
        quick.observer.disturbance[:] = 0.0
        quick.plan.thrust_N[0] = before
        one.append(np.abs(quick.solve(0, x, 0.0, targets, inputs, least, most)[0] - found[0]).max())

    mine = flown(controller, WARM + 7 * count, each)[WARM:]
    theirs = np.array(spent)
    print(f"do-mpc (IPOPT), n = {len(theirs)} programs: median {1e3 * np.median(theirs[:, 0]):.1f} ms wall, "
          f"{1e3 * np.median(theirs[:, 1]):.1f} ms thread; nmpc, whole command: median "
          f"{1e3 * np.median(mine[:, 0]):.2f} ms wall, {1e3 * np.median(mine[:, 1]):.2f} ms thread")
    print(f"ratio of medians: {np.median(theirs[:, 0]) / np.median(mine[:, 0]):.0f} (wall), "
          f"{np.median(theirs[:, 1]) / np.median(mine[:, 1]):.0f} (thread)")
    show("do-mpc / nmpc, whole command, thread", np.median(theirs[:, 1]) / np.median(mine[:, 1]), len(theirs))
    print(f"thrusts of ten iterations against do-mpc: largest difference {1e3 * np.median(gaps):.3f} mN median, "
          f"{1e3 * np.max(gaps):.3f} mN most; first thrust of one iteration: {1e3 * np.median(one):.3f} mN median")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=2000)
    parser.add_argument("--referee", type=int, default=40, help="programs given to do-mpc; 0 leaves it out")
    parser.add_argument("--json", type=Path, metavar="FILE")
    given = parser.parse_args()
    print(f"SYNTHETIC, n = {given.steps} commands each, N = 20; ms from measurement to command")
    print(f"{'':28}{'wall: median':>14}{'99 %':>8}{'thread: median':>16}{'99 %':>8}{'no plan':>9}  C code")
    medians, rows = {}, []
    for name, create in ROWS.items():
        controller = create()
        spent = 1e3 * flown(controller, WARM + given.steps)[WARM:]
        (wall, thread), (wall99, thread99) = np.median(spent, axis=0), np.quantile(spent, 0.99, axis=0)
        print(f"{name:28}{wall:14.3f}{wall99:8.3f}{thread:16.3f}{thread99:8.3f}{controller.counts['solver']:9d}  "
              f"{'yes' if controller.compiled else 'no'}", flush=True)
        medians[name] = thread
        rows.append({"row": name, "n": given.steps, "thread_ms": thread, "thread_p99_ms": thread99, "wall_ms": wall,
                     "wall_p99_ms": wall99})
    if given.json is not None:
        write_json(given.json, {"rows": rows})
    for states in ("12 states", "12 + 4 rotors"):
        show(f"mpc_osqp / mpc_daqp, {states}, whole command, thread",
             medians[f"mpc_osqp, {states}"] / medians[f"mpc_daqp, {states}"], given.steps)
    if given.referee and importlib.util.find_spec("do_mpc") is None:
        print(f"NOT MEASURED against do-mpc: it is not installed; {how_to_install('bench')}")
    elif given.referee:
        against_do_mpc(given.referee)


if __name__ == "__main__":
    main()
