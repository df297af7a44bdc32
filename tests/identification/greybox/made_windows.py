"""Windows flown by a model that is known, instead of by a vehicle."""

import numpy as np

from identification.greybox.arrays import FitWindows
from nanobench_tools import so3
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.physics.rollout import rollout

TERMS = {"thrust_scale": {"s": 1.0}, "thrust_voltage": {"c": (0.01, 0.02, 0.0037)},
         "motor_lag": {"tau_up_s": 0.03, "tau_down_s": 0.045}, "command_delay": {"delay_s": 0.014},
         "motor_imbalance": {"g": (1.02, 0.99, 1.01, 0.98)}, "yaw_torque": {"k_m": 0.004},
         "drag_linear": {"d": (0.016, 0.018, 0.008)}, "drag_torque": {"c": -2e-4},
         "angular_damping": {"d_r": (2e-4, 2.5e-4, 1e-4)}, "inertia": {"inertia_kg_m2": (2.6e-5, 2.4e-5, 3.1e-5)}}
HORIZON, PAST = 50, 50


def true_model() -> Model:
    return Model(Vehicle(), TERMS)


def made_windows(model: Model, n: int = 160, flights: int = 4, seed: int = 0, noise: float = 0.0,
                 own: np.ndarray | None = None) -> FitWindows:
    """Windows around hover; ``noise`` in units of 1 mm, 1 cm/s, 3 mrad, 30 mrad/s; own (flights, P): what is added to
    the parameters of each flight."""
    rng = np.random.default_rng(seed)
    flight = np.repeat(np.arange(flights), n // flights)
    volts = np.repeat(rng.uniform(3.2, 4.1, n)[:, None], PAST + HORIZON, axis=1)
    steps = rng.normal(size=(n, PAST + HORIZON, 4)).cumsum(axis=1)
    motor = (2.9 + 0.3 * rng.normal(size=(n, 1, 1)) + 0.02 * steps) / volts[..., None]
    start = np.concatenate([rng.uniform(0.5, 1.5, (n, 3)), rng.normal(size=(n, 3)),
                            so3.exp(0.2 * rng.normal(size=(n, 3))), 0.5 * rng.normal(size=(n, 3))], axis=1)
    past = (motor[:, :PAST], volts[:, :PAST])
    values = model.values if own is None else model.values + own[flight]
    truth = rollout(model, start, motor[:, PAST:], volts[:, PAST:], past, parameters=values)[:, 1:, :13].copy()
    sizes = np.repeat([1e-3, 1e-2, 3e-3, 3e-2], [3, 3, 4, 3])
    truth += noise * sizes * rng.normal(size=truth.shape)
    truth[..., 6:10] /= np.linalg.norm(truth[..., 6:10], axis=-1, keepdims=True)
    return FitWindows(start, motor[:, PAST:], volts[:, PAST:], past, truth, flight,
                      tuple(f"made {i}" for i in range(flights)))
