"""Stand series made from known laws, as files and as rows."""

import numpy as np

from identification.thrust.stand_series import Stand

GRAM_N = 9.81e-3


def drive(n: int = 120, seed: int = 0, low: float = 0.15, high: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """PWM ratio and battery voltage of n settled points, drawn apart from each other."""
    rng = np.random.default_rng(seed)
    return rng.uniform(low, high, n), rng.uniform(3.2, 4.1, n)


def dc_law(u, voltage, kappa=0.02, rho=0.09, e_0=-0.05):
    """E + rho E^2 = u V + e_0 solved by the quadratic formula, T = kappa E^2 [N]."""
    x = np.maximum(u * voltage + e_0, 0.0)
    return kappa * ((np.sqrt(1.0 + 4.0 * rho * x) - 1.0) / (2.0 * rho)) ** 2


def made(law, n: int = 120, seed: int = 0, noise_N: float = 0.0, name: str = "made", **more) -> Stand:
    u, voltage = drive(n, seed, **more)
    thrust = law(u, voltage) + noise_N * np.random.default_rng(seed + 1000).normal(size=n)
    return Stand(name, f"{name}.csv", f"{name}{seed}", u, voltage, thrust, None, None, float("nan"), 0, 0)


def text(u, voltage, thrust_N, header: str = "pwm,vbat[V],thrust[g]", volts: float = 1.0, grams: float = 1.0) -> str:
    """A table of the stand: counts, volts times ``volts``, grams of all four motors times ``grams``."""
    lines = [header]
    for i in range(len(u)):
        cells = [f"{65535 * u[i]:.0f}"] + ([] if voltage is None else [f"{volts * voltage[i]:.4f}"])
        lines.append(",".join([*cells, f"{grams * 4.0 * thrust_N[i] / GRAM_N:.5f}"]))
    return "\n".join(lines) + "\n"
