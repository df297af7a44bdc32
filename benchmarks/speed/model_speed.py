"""Prediction windows of a model: compiled code against plain NumPy and CasADi's own map, in one run.

    python benchmarks/speed/model_speed.py [--windows N]

Windows of 50 rows at 100 Hz with half a second of inputs before them, one thread, best of several repeats. Counted is
the whole call: shifting and turning the inputs, warming up the rotors, 50 steps of Runge-Kutta 4, all states. CasADi
flies ``step.mapaccum(50).map(n)`` from states that were warmed up already. ``steps alone`` is the compiled kernel on
prepared arrays. The Jacobian of a step is by state and parameters together, again compiled and as CasADi's map.
"""

import argparse
import os
import tempfile
import time
from collections.abc import Callable

os.environ.setdefault("OMP_NUM_THREADS", "1")

import casadi as ca
import numpy as np
from kept import show

from nanobench_tools.physics import Model, Vehicle, numeric, symbolic
from nanobench_tools.physics.batched import batched
from nanobench_tools.physics.inputs import rows
from nanobench_tools.physics.rollout import compiled_step, rollout

HORIZON, PAST = 50, 50
REQUIRED_STEPS_PER_S = 5e6
EQUAL_WITHIN = 1e-12

FITTED = {
    "thrust_voltage": {"c": (-0.0248, 0.0652, -0.0268, 0.00678)}, "thrust_scale": {"s": 0.95},
    "motor_lag": {"tau_up_s": 0.03, "tau_down_s": 0.04}, "yaw_torque": {"k_m": 0.006},
    "drag_linear": {"d": (0.016, 0.0165, 0.006)}, "drag_torque": {"c": -1.5e-4},
    "angular_damping": {"d_r": (1e-5, 1e-5, 1e-5)},
}
EVERYTHING = {
    **FITTED, "thrust_rpm": {"k_f": 2.3e-8}, "mass": {"m": 0.041}, "command_delay": {"delay_s": 0.013},
    "motor_imbalance": {"g": (1.04, 0.97, 1.01, 0.98)}, "com_offset": {"r_m": (0.001, -0.002, 0.003)},
    "inertia": {"inertia_kg_m2": (1.9e-5, 1.7e-5, 3.2e-5)}, "rotor_gyro": {"J_r": -2e-8},
    "drag_rotor": {"d": (1e-6, 2e-6, 5e-7)}, "drag_quadratic": {"q": (0.003, 0.002, 0.001)},
    "inflow": {"k_z": 0.014, "k_h": 0.005}, "ground_effect": {"rho": 1.0, "R": 0.0231},
    "wind": {"w_m_s": (0.3, -0.2, 0.1)}, "force_world": {"f_N": (0.001, 0.002, -0.003)},
    "frame_tilt": {"roll_rad": 0.05, "pitch_rad": -0.08}, "saturation": {"u_max": 0.98, "T_max_N": 0.15},
}
MODELS = {"thrust, lag, drag, torque": FITTED, "every term": EVERYTHING}


def made_windows(n: int) -> tuple:
    """start (n, 13), motor (n, H, 4), battery (n, H), (the same of the past)."""
    rng = np.random.default_rng(0)
    start = np.concatenate([rng.uniform(0.5, 1.5, (n, 3)), rng.normal(size=(n, 3)),
                            rng.normal(0, 0.1, (n, 3)), np.ones((n, 1)), rng.normal(size=(n, 3))], axis=1)
    motor, battery = rng.uniform(0.6, 0.95, (n, PAST + HORIZON, 4)), rng.uniform(3.2, 4.1, (n, PAST + HORIZON))
    return start, motor[:, PAST:], battery[:, PAST:], (motor[:, :PAST], battery[:, :PAST])


def best_time(function: Callable, repeats: int) -> float:
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        function()
        times.append(time.perf_counter() - begin)
    return min(times)


def measure(model: Model, n: int) -> dict[str, float]:
    """Window-steps per second of each way, largest difference between them, and Jacobians per second."""
    given = made_windows(n)
    steps = n * HORIZON
    states = rollout(model, *given)
    window, _ = rows(model, *given[1:], row_hz=100.0)
    start, step = np.ascontiguousarray(states[:, 0].T), compiled_step(model)
    few = max(n // 10, 1)
    mapped = symbolic.step(model).mapaccum(HORIZON).map(few)
    arguments = (ca.DM(start[:, :few]), ca.DM(window[..., :few].transpose(1, 2, 0).reshape(len(window[0]), -1)),
                 ca.repmat(ca.DM(model.values), 1, few * HORIZON))
    theirs = np.asarray(mapped(*arguments)).T.reshape(few, HORIZON, 17)
    plain = numeric.rollout(model, *given)
    difference = max(float(np.max(np.abs(states - plain) / (1 + np.abs(plain)))),
                     float(np.max(np.abs(states[:few, 1:] - theirs) / (1 + np.abs(theirs)))))
    return {
        "parameters": len(model.names),
        "compiled_steps_per_s": steps / best_time(lambda: rollout(model, *given), 10),
        "kernel_steps_per_s": steps / best_time(lambda: step(start, window, model.values), 10),
        "numpy_steps_per_s": steps / best_time(lambda: numeric.rollout(model, *given), 3),
        "casadi_steps_per_s": few * HORIZON / best_time(lambda: mapped(*arguments), 3),
        "largest_difference": difference,
        **jacobians(model, start, window[0], few),
    }


def jacobians(model: Model, states: np.ndarray, inputs: np.ndarray, few: int) -> dict[str, float]:
    """Jacobians of a step per second, compiled and with CasADi's map."""
    step = symbolic.step(model)
    x, u, p = (ca.SX.sym(name, step.size1_in(i)) for i, name in enumerate("xup"))
    y = step(x, u, p)
    function = ca.Function("jacobian", [x, u, p], [ca.jacobian(y, x), ca.jacobian(y, p)], ["x", "u", "p"], ["A", "B"])
    begin = time.perf_counter()
    compiled = batched(function, ["p"])
    made = time.perf_counter() - begin
    mapped, arguments = function.map(few), (ca.DM(states[:, :few]), ca.DM(inputs[:, :few]),
                                            ca.repmat(ca.DM(model.values), 1, few))
    ours = best_time(lambda: compiled(states, inputs, model.values), 5)
    return {"jacobian_compiled_per_s": states.shape[1] / ours, "jacobian_made_s": made,
            "jacobian_casadi_per_s": few / best_time(lambda: mapped(*arguments), 3)}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--windows", type=int, default=4000)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as empty:  # so that the time of compiling is not that of finding
        os.environ["NANOBENCH_CACHE"] = empty
        results = {name: measure(Model(Vehicle(), terms), options.windows) for name, terms in MODELS.items()}
    for name, found in results.items():
        ours = found["compiled_steps_per_s"]
        numpy_ratio, casadi_ratio = ours / found["numpy_steps_per_s"], ours / found["casadi_steps_per_s"]
        print(f"{name} ({found['parameters']} parameters), {options.windows} windows of {HORIZON} rows, one core:\n"
              f"  {ours / 1e6:.1f} million window-steps/s (steps alone {found['kernel_steps_per_s'] / 1e6:.1f}); "
              f"{numpy_ratio:.1f} x NumPy, {casadi_ratio:.1f} x CasADi map, "
              f"largest difference {found['largest_difference']:.1e}\n"
              f"  Jacobian of a step: {found['jacobian_compiled_per_s'] / 1e6:.2f} million/s, "
              f"{found['jacobian_compiled_per_s'] / found['jacobian_casadi_per_s']:.1f} x CasADi map "
              f"(compiled in {found['jacobian_made_s']:.1f} s)")
        show(f"{name}: NumPy / ours", numpy_ratio, options.windows)
        show(f"{name}: CasADi map / ours", casadi_ratio, options.windows)
        show(f"{name}: Jacobian by CasADi map / ours",
             found["jacobian_compiled_per_s"] / found["jacobian_casadi_per_s"], options.windows)
    first = results["thrust, lag, drag, torque"]
    fast = first["compiled_steps_per_s"] >= REQUIRED_STEPS_PER_S
    return 0 if fast and all(r["largest_difference"] < EQUAL_WITHIN for r in results.values()) else 1


if __name__ == "__main__":
    raise SystemExit(main())
