"""Learned controllers behind the Controller Protocol: they fly the plant, an ensemble, or a simulator.

Networks run in JAX; ``physics`` compiles rollouts of identified physics. The same equations in JAX took a hundred
times longer on a processor.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from controllers.gains import Gain, around, whole
from identification.learned.libraries import libraries
from nanobench_tools.methods import Reference, VehicleState
from nanobench_tools.physics import Model
from nanobench_tools.physics.rollout import compiled_lagged
from nanobench_tools.settings import setting
from nanobench_tools.units import GRAVITY_M_S2

from .costs import Costs, inputs_of
from .demonstrations import upright
from .mppi import MppiSettings, improved, shifted
from .policies import SEEN, Network, restored

PERIOD_S = 0.01
FAR: dict[str, Any] = setting("control.pilots.far")


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
    return np.asarray(np.clip(np.nan_to_num(command), 0.0, 1.0))


class Mppi:
    """MPPI on the identified model. Without a rate in its cost and 0.1 s of foresight, as published, it cannot hold a
    quadrotor upright. The further weights it needs are settings.

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
        self._plan = np.full((n, self.settings.horizon, 4), self.settings.first)
        self._rotors = np.full((4, n), 0.25 * self.model.vehicle.mass_kg * GRAVITY_M_S2)
        self._tick = 0
        self._cost = Costs(self.model, self.settings)
        self._follow = compiled_lagged(self.model, 1.0 / self.period_s)

    def command(self, time_s: float, state: VehicleState, reference: Reference) -> np.ndarray:
        """PWM ratios (n, 4)."""
        body = np.concatenate([state.position_m, state.velocity_m_s, state.quaternion, state.rate_rad_s], axis=1)
        start = np.concatenate([body.T, self._rotors])
        rng, (n, horizon, _) = np.random.default_rng([self.settings.seed, self._tick]), self._plan.shape
        self._tick += 1
        noise = self.settings.noise * rng.standard_normal((horizon, 4, n, self.settings.samples), np.float32)
        plan = improved(self._plan, noise.transpose(2, 3, 0, 1), lambda tried: self._cost(
            tried, start, state.battery_V, reference.position_m), self.settings)
        plan = np.where(np.isfinite(plan).all(axis=(1, 2))[:, None, None], plan, self.settings.first)
        inputs = inputs_of(self.model, plan[:, :1].transpose(1, 2, 0), state.battery_V)
        self._rotors = np.nan_to_num(self._follow(self._rotors, inputs, self.model.values, keep="last")[0])
        self._plan = shifted(plan) if abs(self.settings.step_s - self.period_s) < 1e-9 else plan
        return sane(plan[:, 0])


class MppiFar(Mppi):
    """MPPI that looks 0.5 s ahead, pays for tilt and rate and not for commands: settings by hand, from three trials on
    one plant; ``nanobench tune --controller controllers.learned.pilots:MppiFar`` searches further."""

    name = "mppi_far"
    period_s = 0.02
    start = MppiSettings(**FAR)
    tunable: Mapping[str, Gain] = {"temperature": around(FAR["temperature"], "1"), "noise": around(FAR["noise"], "1"),
                                   "position": around(1.0, "1/m^2"), "velocity": around(FAR["velocity"], "s^2/m^2"),
                                   "upright": around(FAR["upright"], "1"),
                                   "turning": around(FAR["turning"], "s^2/rad^2")}


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
