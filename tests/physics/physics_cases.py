"""Models and random states shared by the tests of physics."""

import numpy as np

from nanobench_tools.lookup import registry
from nanobench_tools.physics import Model, Vehicle

CURVE = {"thrust_voltage": {"c": (-0.0248, 0.0652, -0.0268, 0.00678)}}
SPEED = {"thrust_rpm": {"k_f": 2.3e-8}}
ALL = {
    **CURVE, **SPEED, "thrust_scale": {"s": 0.95}, "mass": {"m": 0.0413},
    "motor_lag": {"tau_up_s": 0.03, "tau_down_s": 0.05},
    "command_delay": {"delay_s": 0.013}, "motor_imbalance": {"g": (1.04, 0.97, 1.01, 0.98)},
    "com_offset": {"r_m": (0.001, -0.002, 0.003)}, "inertia": {"inertia_kg_m2": (1.9e-5, 1.7e-5, 3.2e-5)},
    "yaw_torque": {"k_m": 0.006}, "rotor_gyro": {"J_r": -2e-8}, "rotor_reaction": {"J_r": 3e-8},
    "angular_damping": {"d_r": (1e-5, 2e-5, 3e-5)},
    "drag_linear": {"d": (0.016, 0.0165, 0.006)}, "drag_rotor": {"d": (1e-6, 2e-6, 5e-7)},
    "drag_quadratic": {"q": (0.003, 0.002, 0.001)}, "drag_torque": {"c": -1.5e-4},
    "inflow": {"k_z": 0.014, "k_h": 0.005},
    "ground_effect": {"rho": 1.2, "R": 0.0231}, "wind": {"w_m_s": (0.3, -0.2, 0.1)},
    "force_world": {"f_N": (0.001, 0.002, -0.003)}, "frame_tilt": {"roll_rad": 0.05, "pitch_rad": -0.08},
    "saturation": {"u_max": 0.9, "T_max_N": 0.11},
    "slung_load": {"m_kg": 0.004, "l_m": 0.63, "zeta": 0.03, "r_m": (0.03, 0.03, -0.01)},
}
"""Every term but thrust_pwm, which excludes thrust_voltage."""

BASE_FOR = {"thrust_pwm": {}, "thrust_voltage": {}, "drag_rotor": {**CURVE, **SPEED}, "rotor_gyro": {**CURVE, **SPEED},
            "rotor_reaction": {**CURVE, **SPEED, "motor_lag": {"tau_up_s": 0.03, "tau_down_s": 0.05}},
            "wind": {**CURVE, "drag_linear": ALL["drag_linear"]}}
"""What a term cannot do without, where that is more or less than a thrust curve."""

PWM_ONLY = {"thrust_pwm": {"c": (0.001, 0.02, 0.14)}}


def alone(name: str) -> Model:
    """The smallest model with this term."""
    values = PWM_ONLY[name] if name in PWM_ONLY else ALL[name]
    return Model(Vehicle(), {**BASE_FOR.get(name, CURVE), name: values})


def models() -> dict[str, Model]:
    """One model for every registered term, and one of all together; RPM inputs too."""
    found = {name: alone(name) for name in registry.names("terms")}
    found["all"] = Model(Vehicle(), ALL)
    rest = {name: values for name, values in ALL.items() if name != "thrust_voltage"}
    found["all on rpm"] = Model(Vehicle(input="rpm"), {**rest, "saturation": {"T_max_N": 0.11}})
    return found


def draw(model: Model, n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """States (n, 17) and inputs (n, I): any attitude, from low to fast, below and above the command."""
    rng = np.random.default_rng(seed)
    states = np.concatenate([rng.uniform(-2, 2, (n, 2)), rng.uniform(-0.02, 1.5, (n, 1)), rng.normal(0, 2, (n, 3)),
                             rng.normal(size=(n, 4)), rng.normal(0, 5, (n, 3)), rng.uniform(0, 0.15, (n, 4))], axis=1)
    states[:, 6:10] /= np.linalg.norm(states[:, 6:10], axis=1, keepdims=True)
    low, high = (0.0, 1.0) if model.vehicle.input == "pwm" else (500.0, 2500.0)
    inputs = [rng.uniform(low, high, (n, 4)), rng.uniform(3.0, 4.2, (n, 1))]
    if "command_delay" in model:
        inputs += [rng.uniform(low, high, (n, 4)), np.ones((n, 1))]
    return states, np.concatenate(inputs, axis=1)


def windows(model: Model, n: int, seed: int, horizon: int = 20, past: int = 50):
    """start (n, 13), motor (n, H, 4), battery (n, H) and the same of the past."""
    rng = np.random.default_rng(seed)
    low, high = (0.5, 0.95) if model.vehicle.input == "pwm" else (1200.0, 2200.0)
    states, _ = draw(model, n, seed)
    states[:, 2] += 0.3
    return (states[:, :13], rng.uniform(low, high, (n, horizon, 4)), rng.uniform(3.2, 4.1, (n, horizon)),
            (rng.uniform(low, high, (n, past, 4)), rng.uniform(3.2, 4.1, (n, past))))
