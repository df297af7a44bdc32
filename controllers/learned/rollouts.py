"""Task 2 as published for learned controllers: flown on learned dynamics, along the log of a flight.

The dynamics say the next position, velocity and attitude from the last observation and the command; setpoint and
battery are those of the log. Position and velocity are kept within 5 m and 5 m/s, attitude to unit length. A flight
that is more than LOST_M from the logged one ends there. Scores are over the rows before that, against the logged
position, not against the setpoint as those of real flights are. A row counts as diverged beyond 0.5 m.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from identification.learned.libraries import Array, libraries
from nanobench_tools import so3
from nanobench_tools.metrics import tracking
from nanobench_tools.metrics.trajectory import rms

from .demonstrations import OBSERVED, STATE, Demonstration
from .mppi import MppiSettings, improved, shifted
from .policies import SEEN, Network, restored

LOST_M = 2.0
BOUND = 5.0


def rolled(pilot: str, networks: dict[str, Network], flights: Sequence[Demonstration],
           settings: MppiSettings | None = None) -> list[np.ndarray]:
    """Observations (m, 14) of every flight's longest stretch on the learned dynamics, until it was lost.

    The policy ``pilot`` (``bc_mlp``, ``bc_lstm``, ``mppi``) flies it."""
    longest = max(len(d.observed[d.longest]) for d in flights)
    run = _runner(pilot, networks, settings or MppiSettings())
    found = []
    for flight in flights:
        log = flight.observed[flight.longest]
        padded = np.concatenate([log, np.repeat(log[-1:], longest - len(log), axis=0)])
        states = np.asarray(run(padded.astype(np.float32)))[:len(log)]
        off = np.linalg.norm(states[:, :3] - log[:, :3], axis=1)
        lost = np.flatnonzero(~(off <= LOST_M))
        found.append(states[:lost[0] if len(lost) else len(log)])
    return found


def dynamics_step(known: Network) -> tuple[Any, Any]:
    """(scaled(observed), after(observed (n, 14), action (n, 4), log (14,)) -> (n, 14) raw one row later).

    ``log`` is the logged observation of that row."""
    jnp = libraries().jnp
    dynamics, mean, spread = restored(known), jnp.asarray(known.mean), jnp.asarray(known.spread)

    def scaled(observed: Array) -> Array:
        return (observed - mean) / spread

    def after(observed: Array, action: Array, log: Array) -> Array:
        moved = (scaled(observed)[:, :STATE] + dynamics(scaled(observed), action)) * spread[:STATE] + mean[:STATE]
        turned = moved[:, 6:STATE]
        length = jnp.sqrt(jnp.sum(turned**2, axis=1, keepdims=True))
        outside = jnp.broadcast_to(log[STATE:], (len(moved), OBSERVED - STATE))
        return jnp.concatenate([jnp.clip(moved[:, :6], -BOUND, BOUND), turned / jnp.maximum(length, 1e-6), outside], 1)

    return scaled, after


def planner(networks: dict[str, Network], settings: MppiSettings) -> Any:
    """plan(plan (T, 4), observed (14,), tick) -> (plan one step on, command (4,)), on the learned dynamics. Setpoint
    and battery stay as they are now; a step's cost is taken where its command is given (as released)."""
    with_jax = libraries()
    jax, jnp, lax = with_jax.jax, with_jax.jnp, with_jax.lax
    scaled, after = dynamics_step(networks["dynamics"])
    policy = restored(networks["bc_mlp"])

    def plan_once(plan: Array, observed: Array, tick: Array) -> tuple[Array, Array]:
        noise = settings.noise * jax.random.normal(jax.random.fold_in(jax.random.key(settings.seed), tick),
                                                   (settings.samples, *plan.shape))

        def cost(tried: Array) -> Array:
            def step(state: Array, action: Array) -> tuple[Array, Array]:
                cloned = jnp.clip(policy(scaled(state)), 0.0, 1.0)
                off = jnp.sum((state[:, :3] - state[:, STATE:STATE + 3]) ** 2, axis=1)
                fast = jnp.sum(state[:, 3:6] ** 2, axis=1)
                price = (settings.position * off + settings.velocity * fast + settings.effort * jnp.sum(action**2, 1)
                         + settings.prior * jnp.sum((action - cloned) ** 2, axis=1))
                return after(state, action, observed), price

            start = jnp.broadcast_to(observed, (settings.samples, OBSERVED))
            return lax.scan(step, start, tried.swapaxes(0, 1))[1].sum(axis=0)

        plan = improved(plan, noise, cost, settings)
        return shifted(plan), plan[0]

    return plan_once


def _runner(pilot: str, networks: dict[str, Network], settings: MppiSettings) -> Any:
    """log (m, 14) -> observations (m, 14), compiled."""
    with_jax = libraries()
    jax, jnp, lax = with_jax.jax, with_jax.jnp, with_jax.lax
    scaled, after = dynamics_step(networks["dynamics"])
    policy = restored(networks["bc_mlp" if pilot == "mppi" else pilot])
    plan_once: Any = planner(networks, settings) if pilot == "mppi" else None

    def mlp(memory: Array, observed: Array, _: Array) -> tuple[Array, Array]:
        return memory, jnp.clip(policy(scaled(observed)[None])[0], 0.0, 1.0)

    def lstm(memory: Array, observed: Array, tick: Array) -> tuple[Array, Array]:
        now = scaled(observed)
        memory = jnp.where(tick == 0, jnp.broadcast_to(now, memory.shape), jnp.concatenate([memory[1:], now[None]]))
        return memory, policy(memory[None])[0]

    pilots = {"bc_mlp": (mlp, jnp.zeros(())), "bc_lstm": (lstm, jnp.zeros((SEEN, OBSERVED))),
              "mppi": (plan_once, jnp.full((settings.horizon, 4), settings.first))}
    command, first = pilots[pilot]

    def run(log: Array) -> Array:
        def step(carry: Array, row: Array) -> tuple[Array, Array]:
            observed, memory = carry
            tick, later = row
            memory, action = command(memory, observed, tick)
            return (after(observed[None], action[None], later)[0], memory), observed

        rows = (jnp.arange(len(log)), jnp.concatenate([log[1:], log[-1:]]))
        return lax.scan(step, (log[0], first), rows)[1]

    return jax.jit(run)


def score(states: np.ndarray, flight: Demonstration) -> dict[str, float]:
    """Published metrics of one flight, and the same error against the setpoint (``setpoint_rmse_m``). The latter is
    the error in the rows of real flights; ``valid_percent``: of its rows that were flown before it was lost."""
    log = flight.observed[flight.longest]
    flown, wanted = states.astype(float), log[:len(states)].astype(float)
    errors = np.linalg.norm(flown[:, :3] - wanted[:, :3], axis=1)
    yaw = [so3.euler_zyx(rows[:, 6:STATE])[:, 2] for rows in (flown, wanted)]
    return {"rmse_m": rms(errors), "ade_m": float(errors.mean()),
            "velocity_rmse_m_s": rms(np.linalg.norm(flown[:, 3:6] - wanted[:, 3:6], axis=1)),
            "heading_deg": tracking.heading_error_deg(*yaw), "divergence_percent": tracking.divergence_percent(errors),
            "setpoint_rmse_m": rms(np.linalg.norm(flown[:, :3] - flown[:, STATE:STATE + 3], axis=1)),
            "logged_setpoint_rmse_m": rms(np.linalg.norm(log[:, :3] - log[:, STATE:STATE + 3], axis=1).astype(float)),
            "valid_percent": 100.0 * len(states) / len(log)}
