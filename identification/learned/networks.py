"""The published networks of Task 1 in one normalised space: residual MLP, physics + residual, LSTM.

Source: S. I. Ullah, J. Baca, "NanoBench" (arXiv 2603.09908, 2026), section on Task 1: state of 12 (position, velocity,
rotation vector, angular rate), four motor commands.

- residual MLP: five fully connected layers of 64 with ReLU that predict the change of state;
- the same on top of the published physics;
- one LSTM layer of 64 from the start state and the command sequence, increments accumulated.

Battery voltage as a fifth input is ours.
"""

import functools
from types import SimpleNamespace
from typing import Any

import numpy as np

from identification.published_physics import K_THRUST_N_S2, MASS_KG, OMEGA_FULL_RAD_S, PublishedPhysics
from nanobench_tools.errors import UsageError
from nanobench_tools.units import GRAVITY_M_S2

from .libraries import Array, libraries

KINDS = ("residual_mlp", "physics_residual", "lstm")
WIDTH, DEPTH = 64, 5
STATES = 12
STEP_S = 0.01


@functools.cache
def modules() -> SimpleNamespace:
    """The network classes (they need equinox to be defined). Each has ``roll(start (n, 12), inputs
    (n, H, k)) -> states (n, H, 12)``, all in the normalised space."""
    with_jax = libraries()
    jax, jnp, eqx, lax = with_jax.jax, with_jax.jnp, with_jax.eqx, with_jax.lax

    class ResidualMlp(eqx.Module):  # type: ignore[name-defined, misc]
        """x + MLP(x, u)."""

        mlp: Any

        def __init__(self, inputs: int, key: Any, width: int = WIDTH, depth: int = DEPTH) -> None:
            self.mlp = small(eqx.nn.MLP(STATES + inputs, STATES, width, depth, jax.nn.relu, key=key))

        def roll(self, start: Array, inputs: Array) -> Array:
            def step(x: Array, u: Array) -> tuple[Array, Array]:
                x = x + jax.vmap(self.mlp)(jnp.concatenate([x, u], axis=1))
                return x, x

            return lax.scan(step, start, inputs.swapaxes(0, 1))[1].swapaxes(0, 1)

    class PhysicsResidual(eqx.Module):  # type: ignore[name-defined, misc]
        """The published physics rolled out; the network corrects it in the normalised space."""

        mlp: Any
        scaling: tuple[Any, ...] = eqx.field(static=True)

        def __init__(self, inputs: int, key: Any, scaling: tuple[Any, ...], width: int = WIDTH,
                     depth: int = DEPTH) -> None:
            self.mlp = small(eqx.nn.MLP(STATES + inputs, STATES, width, depth, jax.nn.relu, key=key))
            self.scaling = scaling

        def roll(self, start: Array, inputs: Array) -> Array:
            mean, spread, u_mean, u_spread = (jnp.array(v, jnp.float32) for v in self.scaling)

            def step(x: Array, u: Array) -> tuple[Array, Array]:
                motor = u[:, :4] * u_spread[:4] + u_mean[:4]
                after = (physics_step(jnp, x * spread + mean, motor) - mean) / spread
                x = after + jax.vmap(self.mlp)(jnp.concatenate([x, u], axis=1))
                return x, x

            return lax.scan(step, start, inputs.swapaxes(0, 1))[1].swapaxes(0, 1)

    class Lstm(eqx.Module):  # type: ignore[name-defined, misc]
        """Start state -> first memory; commands -> increments, accumulated."""

        cell: Any
        hidden: Any
        memory: Any
        out: Any

        def __init__(self, inputs: int, key: Any, width: int = WIDTH) -> None:
            keys = jax.random.split(key, 4)
            self.cell = eqx.nn.LSTMCell(inputs, width, key=keys[0])
            self.hidden = eqx.nn.Linear(STATES, width, key=keys[1])
            self.memory = eqx.nn.Linear(STATES, width, key=keys[2])
            self.out = small(eqx.nn.Linear(width, STATES, key=keys[3]))

        def roll(self, start: Array, inputs: Array) -> Array:
            def step(carry: Array, u: Array) -> tuple[Array, Array]:
                x, state = carry
                state = jax.vmap(self.cell)(u, state)
                x = x + jax.vmap(self.out)(state[0])
                return (x, state), x

            first = (jnp.tanh(jax.vmap(self.hidden)(start)), jnp.tanh(jax.vmap(self.memory)(start)))
            return lax.scan(step, (start, first), inputs.swapaxes(0, 1))[1].swapaxes(0, 1)

    def small(layer: Any) -> Any:
        """The last layer starts near nothing: an untrained network says that the state stays (or obeys physics)."""
        last = layer.layers[-1] if hasattr(layer, "layers") else layer
        where = (lambda m: (m.layers[-1].weight, m.layers[-1].bias)) if last is not layer else (
            lambda m: (m.weight, m.bias))
        return eqx.tree_at(where, layer, (0.01 * last.weight, 0.0 * last.bias))

    return SimpleNamespace(residual_mlp=ResidualMlp, physics_residual=PhysicsResidual, lstm=Lstm)


def network(kind: str, voltage: bool, scaling: tuple[np.ndarray, ...], seed: int) -> Any:
    """A fresh network of ``kind``; ``voltage``: battery as a fifth input. Raises UsageError for an unknown kind."""
    if kind not in KINDS:
        raise UsageError(f"unknown network {kind!r}; known: {', '.join(KINDS)}")
    key, inputs = libraries().jax.random.key(seed), 5 if voltage else 4
    if kind == "physics_residual":
        return modules().physics_residual(inputs, key, tuple(tuple(np.asarray(v, float).tolist()) for v in scaling))
    return getattr(modules(), kind)(inputs, key)


def physics_step(xp: Any, x: Any, motor: Any) -> Any:
    """(n, 12) states 10 ms later by the published physics, with the array module ``xp``. RK4 with the rate held, motor
    (n, 4) PWM ratios.

    ``identification.published_physics`` has it in closed form over a window. One array per component: compilers fuse
    these."""
    position, velocity, vector, rate = (tuple(x[:, i + k] for k in range(3)) for i in (0, 3, 6, 9))
    thrust = xp.minimum(K_THRUST_N_S2 * OMEGA_FULL_RAD_S**2 / MASS_KG * xp.sum(motor**2, axis=1),
                        PublishedPhysics.thrust_to_weight * GRAVITY_M_S2)
    first = quaternion(xp, vector)
    half = quaternion(xp, tuple(0.5 * STEP_S * w for w in rate))
    middle = multiply(first, half)
    last = multiply(middle, half)
    a, b, c = (tuple(thrust * u - g for u, g in zip(up(q), (0.0, 0.0, GRAVITY_M_S2), strict=True))
               for q in (first, middle, last))
    moved = tuple(p + STEP_S * v + STEP_S**2 / 6.0 * (f + 2.0 * m)
                  for p, v, f, m in zip(position, velocity, a, b, strict=True))
    faster = tuple(v + STEP_S / 6.0 * (f + 4.0 * m + e) for v, f, m, e in zip(velocity, a, b, c, strict=True))
    return xp.stack([*moved, *faster, *rotation_vector(xp, last), *rate], axis=1)


def quaternion(xp: Any, vector: Any) -> tuple[Any, ...]:
    """Components x, y, z, w of a rotation vector's; smooth at zero, so that gradients are finite."""
    square = sum(v * v for v in vector)
    little = square < 1e-8
    angle = xp.sqrt(xp.where(little, 1.0, square))
    half = xp.where(little, 0.5 - square / 48.0, xp.sin(0.5 * angle) / angle)
    return (*(half * v for v in vector), xp.where(little, 1.0 - square / 8.0, xp.cos(0.5 * angle)))


def rotation_vector(xp: Any, q: tuple[Any, ...]) -> tuple[Any, ...]:
    """Components of a unit quaternion's, length at most pi."""
    sign = xp.where(q[3] < 0.0, -1.0, 1.0)
    square = sum(v * v for v in q[:3])
    little = square < 1e-8
    sine = xp.sqrt(xp.where(little, 1.0, square))
    factor = sign * xp.where(little, 2.0 + square / 3.0, 2.0 * xp.arctan2(sine, sign * q[3]) / sine)
    return tuple(factor * v for v in q[:3])


def multiply(a: tuple[Any, ...], b: tuple[Any, ...]) -> tuple[Any, ...]:
    """Hamilton product."""
    (ax, ay, az, aw), (bx, by, bz, bw) = a, b
    return (aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw, aw * bw - ax * bx - ay * by - az * bz)


def up(q: tuple[Any, ...]) -> tuple[Any, ...]:
    """The body's z axis in the world."""
    x, y, z, w = q
    return 2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)
