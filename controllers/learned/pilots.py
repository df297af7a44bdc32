"""Learned controllers behind the Controller Protocol: they fly the plant, an ensemble, or a simulator."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from controllers.gains import Gain, around, whole
from identification.learned.libraries import libraries
from nanobench_tools.errors import InputError
from nanobench_tools.methods import Reference, VehicleState
from nanobench_tools.physics import Model
from nanobench_tools.physics.equations import Equations
from nanobench_tools.physics.model import POSITION, RATE, VELOCITY
from nanobench_tools.physics.ops import Ops
from nanobench_tools.units import GRAVITY_M_S2

from .demonstrations import upright
from .mppi import MppiSettings, improved, shifted
from .policies import SEEN, Network, restored

PERIOD_S = 0.01
HELD_V = 3.5


class ClonedPolicy:
    """A policy cloned from the onboard PID. It sees what it was shown: position, velocity, attitude, setpoint and
    battery, no rate; commands come every 10 ms."""

    information = "as flown"
    period_s = PERIOD_S
    on_board = True
    """It stands for the onboard controller it was cloned from: no radio between it and the motors."""

    def __init__(self, network: Network, name: str = "") -> None:
        self.network, self.name = network, name or network.kind

    def reset(self, n: int) -> None:
        self._seen: np.ndarray | None = None
        made = restored(self.network)
        self._run = libraries().jax.jit(lambda seen: made(seen))

    def command(self, time_s: float, state: VehicleState, reference: Reference) -> np.ndarray:
        """PWM ratios (n, 4)."""
        seen = (observation(state, reference) - self.network.mean) / self.network.spread
        if self.network.kind == "bc_lstm":
            self._seen = (np.repeat(seen[:, None], SEEN, axis=1) if self._seen is None
                          else np.concatenate([self._seen[:, 1:], seen[:, None]], axis=1))
            seen = self._seen
        return sane(np.asarray(self._run(seen.astype(np.float32)), float))


def observation(state: VehicleState, reference: Reference) -> np.ndarray:
    """(n, 14) as policies were shown them."""
    return np.concatenate([state.position_m, state.velocity_m_s, upright(state.quaternion), reference.position_m,
                           state.battery_V[:, None]], axis=1)


def sane(command: np.ndarray) -> np.ndarray:
    """Within 0..1; motors of a vehicle whose network says no number stand still."""
    return np.clip(np.nan_to_num(command), 0.0, 1.0)


class Mppi:
    """MPPI on the identified model. Without a rate in its cost and 0.1 s of foresight, as published, it cannot hold a
    quadrotor upright; what it needs beside that are settings.

    The state is that of the vehicle; rotors, which nobody measures, follow from its own commands.
    """

    information = "as flown"
    period_s = PERIOD_S
    on_board = True
    name = "mppi"
    start = MppiSettings()
    tunable: Mapping[str, Gain] = {}

    def __init__(self, model: Model, gains: Mapping[str, float] | None = None, **settings: float) -> None:
        given: dict[str, Any] = {name: round(v) if name in ("horizon", "samples", "seed") else float(v)
                                 for name, v in {**settings, **(whole(self.tunable, gains, self.name)
                                                                if self.tunable else {})}.items()}
        self.settings = replace(self.start, **given)
        self.model = model

    def reset(self, n: int) -> None:
        jnp = libraries().jnp
        self._plan = jnp.full((n, self.settings.horizon, 4), self.settings.first, jnp.float32)
        self._rotors: np.ndarray | None = None
        self._tick = 0
        self._run = _planner(self.model, self.settings)

    def command(self, time_s: float, state: VehicleState, reference: Reference) -> np.ndarray:
        """PWM ratios (n, 4)."""
        body = np.concatenate([state.position_m, state.velocity_m_s, state.quaternion, state.rate_rad_s], axis=1)
        if self._rotors is None:
            self._rotors = np.full((len(body), 4), 0.25 * self.model.vehicle.mass_kg * GRAVITY_M_S2)
        whole = np.concatenate([body, self._rotors], axis=1).astype(np.float32)
        plan, action, rotors = self._run(self._plan, whole, state.battery_V.astype(np.float32),
                                         reference.position_m.astype(np.float32), self._tick)
        self._tick += 1
        good = np.isfinite(np.asarray(plan)).all(axis=(1, 2))
        self._plan = libraries().jnp.where(good[:, None, None], plan, self.settings.first)
        self._rotors = np.nan_to_num(np.asarray(rotors, float))
        return sane(np.asarray(action, float))


class MppiFar(Mppi):
    """MPPI that looks 0.5 s ahead, pays for tilt and rate and not for commands: settings by hand, from three trials on
    one plant; ``nanobench tune --controller controllers.learned.pilots:MppiFar`` searches further."""

    name = "mppi_far"
    start = MppiSettings(horizon=25, samples=512, temperature=0.02, noise=0.1, velocity=0.3, effort=0.0, price=0.0,
                         first=0.82, step_s=0.02, upright=2.0, turning=0.01)
    tunable: Mapping[str, Gain] = {"temperature": around(0.02, "1"), "noise": around(0.1, "1"),
                                   "position": around(1.0, "1/m^2"), "velocity": around(0.3, "s^2/m^2"),
                                   "upright": around(2.0, "1"), "turning": around(0.01, "s^2/rad^2")}


def model_step(model: Model, step_s: float) -> Any:
    """step(states (17, n), motor (4, n), battery (n)) -> states (17, n) by the very equations of the model, in JAX.
    Raises InputError for a model of rotor speeds."""
    if model.vehicle.input != "pwm":
        raise InputError("simulator", f"its input is {model.vehicle.input}", "MPPI commands PWM; give another one")
    jnp = libraries().jnp
    ops = Ops(jnp.sqrt, jnp.exp, jnp.sin, jnp.cos, jnp.abs, jnp.minimum, jnp.maximum, jnp.where)
    made = Equations(model, model.values.tolist(), ops, step_s)
    extra = len(model.inputs) - 5  # a delay of the commands: what was commanded before is not planned anew

    def step(states, motor, battery):
        inputs = [*motor, battery, *([*motor, 0.0 * battery] if extra else [])]
        found = made.step(list(states), inputs, max(1, round(step_s / PERIOD_S)))
        return jnp.stack([jnp.broadcast_to(x, states.shape[1:]) for x in found])

    return step


@functools.lru_cache(maxsize=8)
def _planner(model: Model, settings: MppiSettings) -> Any:
    """(plans (n, T, 4), states (n, 17), battery (n), setpoints (n, 3), tick) -> (plans one step on, commands (n, 4),
    rotors (n, 4) after the command), compiled."""
    with_jax = libraries()
    jax, jnp, lax = with_jax.jax, with_jax.jnp, with_jax.lax
    ahead, soon = model_step(model, settings.step_s), model_step(model, PERIOD_S)

    def one(plan, state, battery, goal, key):
        noise = settings.noise * jax.random.normal(key, (settings.samples, settings.horizon, 4))

        def cost(tried):
            volts = jnp.full(settings.samples, battery)

            def step(states, action):
                states = ahead(states, action.T, volts)
                off = jnp.sum((states[POSITION] - goal[:, None]) ** 2, axis=0)
                fast, spin = jnp.sum(states[VELOCITY] ** 2, axis=0), jnp.sum(states[RATE] ** 2, axis=0)
                tilt = 2.0 * (states[6] ** 2 + states[7] ** 2)
                price = (settings.position * off + settings.velocity * fast + settings.upright * tilt
                         + settings.turning * spin + settings.effort * jnp.sum(action**2, axis=1))
                return states, jnp.nan_to_num(price, nan=1e6, posinf=1e6)

            start = jnp.broadcast_to(state[:, None], (len(state), settings.samples))
            return lax.scan(step, start, tried.swapaxes(0, 1))[1].sum(axis=0)

        plan = improved(plan, noise, cost, settings)
        after = soon(state[:, None], plan[0][:, None], battery[None])[13:, 0]
        return (plan if settings.step_s > PERIOD_S else shifted(plan)), plan[0], after

    @jax.jit
    def run(plans, states, battery, goals, tick):
        keys = jax.random.split(jax.random.fold_in(jax.random.key(settings.seed), tick), len(plans))
        return jax.vmap(one)(plans, states, battery, goals, keys)

    return run


class MppiLearned:
    """MPPI as published: on the learned dynamics, with the cloned policy in its cost."""

    information = "as flown"
    period_s = PERIOD_S
    on_board = True
    name = "mppi_learned"

    def __init__(self, networks: dict[str, Network], settings: MppiSettings | None = None) -> None:
        self.networks, self.settings = networks, settings or MppiSettings()

    def reset(self, n: int) -> None:
        jnp = libraries().jnp
        self._plan = jnp.full((n, self.settings.horizon, 4), self.settings.first, jnp.float32)
        self._tick = 0
        self._run = _learned_planner(self.networks, self.settings)

    def command(self, time_s: float, state: VehicleState, reference: Reference) -> np.ndarray:
        """PWM ratios (n, 4)."""
        plan, action = self._run(self._plan, observation(state, reference).astype(np.float32), self._tick)
        self._tick += 1
        self._plan = libraries().jnp.nan_to_num(plan, nan=self.settings.first)
        return sane(np.asarray(action, float))


def _learned_planner(networks: dict[str, Network], settings: MppiSettings) -> Any:
    from .rollouts import planner

    jax = libraries().jax
    plan_once = planner(networks, settings)
    return jax.jit(lambda plans, observed, tick: jax.vmap(
        lambda plan, seen, lane: plan_once(plan, seen, tick * 1009 + lane))(
            plans, observed, libraries().jnp.arange(len(plans))))
