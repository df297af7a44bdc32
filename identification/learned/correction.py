"""A small recurrent network that corrects a prediction by physics: what force and moment did the physics not know?

It predicts an angular acceleration and a specific force for every step. Their effect on the state follows from
kinematics (errors of attitude in body axes, first order: J. Sola, "Quaternion kinematics for the error-state Kalman
filter", 2017). A network that says nothing leaves the physics as it is.
"""

import functools
from types import SimpleNamespace
from typing import Any

import numpy as np

from nanobench_tools import so3
from nanobench_tools.methods import Prediction, Windows
from nanobench_tools.settings import count, setting

from .libraries import Array, libraries

WIDTH = count("learned.correction.width")
UNITS = setting("learned.correction.units")
SIZES = np.array(UNITS)


@functools.cache
def modules() -> SimpleNamespace:
    """{Correction}: the network class."""
    with_jax = libraries()
    jax, jnp, eqx, lax = with_jax.jax, with_jax.jnp, with_jax.eqx, with_jax.lax

    class Correction(eqx.Module):  # type: ignore[name-defined, misc]
        """context (n, C), steps (n, H, S), both scaled -> errors of the physics along the window."""

        first: Any
        cell: Any
        out: Any

        def __init__(self, context: int, steps: int, key: Any, width: int = WIDTH) -> None:
            keys = jax.random.split(key, 3)
            self.first = eqx.nn.Linear(context, width, key=keys[0])
            self.cell = eqx.nn.GRUCell(steps, width, key=keys[1])
            out = eqx.nn.Linear(width, 6, key=keys[2])
            self.out = eqx.tree_at(lambda m: (m.weight, m.bias), out, (0.01 * out.weight, 0.0 * out.bias))

        def __call__(self, context: Array, steps: Array, thrust: Array, rate: Array, attitude: Array, dt: float,
                     back: Array | None = None) -> Array:
            """Errors of the predictions after the correction.

            - thrust, rate (n, H, 3): of the physics, body.
            - attitude (n, H, 3, 3): at the starts of the steps.
            - back (n, 6, 6): turns the network's accelerations into those of the vehicle where it was shown the
              vehicle turned.

            Errors (n, H, 12): position, velocity (world), attitude (body), rate."""
            hidden = jnp.tanh(jax.vmap(self.first)(context))
            zero = jnp.zeros((len(context), 3))

            def step(carry: Array, given: Array) -> tuple[Array, Array]:
                hidden, position, velocity, angle, turning = carry
                now, force, spin, matrix = given
                hidden = jax.vmap(self.cell)(now, hidden)
                correction = jax.vmap(self.out)(hidden) * jnp.asarray(SIZES, jnp.float32)
                if back is not None:
                    correction = jnp.einsum("nij,nj->ni", back, correction)
                felt = correction[:, 3:] + jnp.cross(angle, force)
                gained = jnp.einsum("nij,nj->ni", matrix, felt)
                position = position + dt * velocity + 0.5 * dt**2 * gained
                velocity = velocity + dt * gained
                angle = angle + dt * (turning + 0.5 * dt * correction[:, :3] - jnp.cross(spin, angle))
                turning = turning + dt * correction[:, :3]
                return ((hidden, position, velocity, angle, turning),
                        jnp.concatenate([position, velocity, angle, turning], axis=1))

            moved = (steps, thrust, rate, attitude)
            return lax.scan(step, (hidden, zero, zero, zero, zero),
                            tuple(a.swapaxes(0, 1) for a in moved))[1].swapaxes(0, 1)

    return SimpleNamespace(Correction=Correction)


def corrected(predicted: Prediction, errors: np.ndarray) -> Prediction:
    """The physics with errors (n, H, 12) put right."""
    return Prediction(predicted.position_m + errors[..., :3], predicted.velocity_m_s + errors[..., 3:6],
                      so3.multiply(predicted.quaternion, so3.exp(errors[..., 6:9])),
                      predicted.rate_rad_s + errors[..., 9:])


def wanted(predicted: Prediction, came: Prediction) -> np.ndarray:
    """Errors (n, H, 12) that would put the physics right."""
    return np.concatenate([came.position_m - predicted.position_m, came.velocity_m_s - predicted.velocity_m_s,
                           so3.log(so3.multiply(so3.conjugate(predicted.quaternion), came.quaternion)),
                           came.rate_rad_s - predicted.rate_rad_s], axis=-1)


def starts(windows: Windows, predicted: Prediction) -> tuple[np.ndarray, np.ndarray]:
    """Rate (n, H, 3) and attitude (n, H, 3, 3) of the physics at the starts of the steps."""
    rate = np.concatenate([windows.rate_rad_s[:, None], predicted.rate_rad_s[:, :-1]], axis=1)
    turned = np.concatenate([windows.quaternion[:, None], predicted.quaternion[:, :-1]], axis=1)
    return rate, so3.matrix(turned.reshape(-1, 4)).reshape(*turned.shape[:2], 3, 3)
