"""The rigid-body baseline of the published Task 1, with its published parameters.

Equations: dv/dt = R e3 T/m - g e3, dp/dt = v, the body rate is constant. Thrust is T = min(k_t sum Omega_i^2, ratio m
g) along body z, without drag; Runge-Kutta 4 at the step of the rows, inputs held over a step. Source of m = 0.04085
kg: NanoBench (arXiv 2603.09908). Source of k_t = 3.72e-8 N s^2 and ratio = 2.0: its code base (Busetto et al. 2025).

How PWM became rotor speed is not published. Here Omega = OMEGA_FULL u, 25,000 rpm at full duty. Then k_t sum Omega^2
is 1.8 m g on average and above 1.5 m g in 96 % of airborne rows (53 flights). With the thrust-to-weight ratio 1.5 that
the paper states (0.6 N), the limit nearly always acts, so the mapping hardly matters. The errors agree with the
published row to 5 % in velocity and 8 % in position. With ratio 2.0, as released, the limit acts in 15 % of rows, the
mapping decides, and the errors are 1.5 times the published ones. ``published_physics`` is the one that agrees,
``published_physics_ratio2`` the one with the parameters as released. Either way the vehicle of the model is too
strong.
"""

import numpy as np

from nanobench_tools import so3
from nanobench_tools.methods import Prediction, Windows
from nanobench_tools.results.fitted_values import Estimate
from nanobench_tools.units import GRAVITY_M_S2

MASS_KG = 0.04085
K_THRUST_N_S2 = 3.72e-8
OMEGA_FULL_RAD_S = 25000.0 * 2.0 * np.pi / 60.0


class PublishedPhysics:
    """The published rigid body, thrust without limit. ``thrust_to_weight`` limits it at that multiple of the weight."""

    name = "published_physics"
    information = "state"
    thrust_to_weight = 1.5

    @property
    def parameters(self) -> dict[str, Estimate]:
        """By name; published numbers, so without intervals."""
        values = {"mass": (MASS_KG, "kg"), "k_thrust": (K_THRUST_N_S2, "N s^2/rad^2"),
                  "omega_full": (OMEGA_FULL_RAD_S, "rad/s"), "thrust_to_weight": (self.thrust_to_weight, "1")}
        return {name: Estimate(value, None, unit) for name, (value, unit) in values.items()}

    def specific_thrust(self, motor: np.ndarray) -> np.ndarray:
        """(...) m/s^2: T/m for PWM ratios (..., 4)."""
        thrust_N = K_THRUST_N_S2 * np.sum((OMEGA_FULL_RAD_S * motor) ** 2, axis=-1)
        return np.asarray(np.minimum(thrust_N / MASS_KG, self.thrust_to_weight * GRAVITY_M_S2))

    def predict(self, windows: Windows) -> Prediction:
        """The rate is held, so the attitude is R_0 Exp(w t) exactly and the acceleration is known at every stage."""
        step = 1.0 / windows.rate_hz
        h = windows.horizon
        time_s = 0.5 * step * np.arange(2 * h + 1)  # starts and middles of all steps
        angle = windows.rate_rad_s[:, None] * time_s[:, None]
        quaternion = so3.multiply(windows.quaternion[:, None], so3.exp(angle))
        up = so3.rotate(quaternion, np.array([0.0, 0.0, 1.0]))
        thrust = self.specific_thrust(windows.motor)[..., None]
        gravity = np.array([0.0, 0.0, -GRAVITY_M_S2])
        first, middle, last = (thrust * up[:, part] + gravity
                               for part in (slice(0, -2, 2), slice(1, None, 2), slice(2, None, 2)))
        velocity = windows.velocity_m_s[:, None] + np.cumsum(step / 6.0 * (first + 4.0 * middle + last), axis=1)
        before = np.concatenate([windows.velocity_m_s[:, None], velocity[:, :-1]], axis=1)
        moved = step * before + step**2 / 6.0 * (first + 2.0 * middle)
        return Prediction(windows.position_m[:, None] + np.cumsum(moved, axis=1), velocity, quaternion[:, 2::2],
                          np.repeat(windows.rate_rad_s[:, None], h, axis=1))


class PublishedPhysicsRatio2(PublishedPhysics):
    """The published rigid body, thrust limited at twice the weight, as released."""

    name = "published_physics_ratio2"
    thrust_to_weight = 2.0
