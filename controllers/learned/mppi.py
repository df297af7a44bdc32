"""Model predictive path integral control: many noisy copies of a plan are rolled out, and mixed by what they cost.

Source: G. Williams et al., "Information theoretic MPC for model-based reinforcement learning" (ICRA 2017), algorithm
2. Commands are limited to 0..1 before they are rolled out, the plan is shifted by one step, its last step repeated.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from identification.learned.libraries import libraries
from nanobench_tools.errors import UsageError


@dataclass(frozen=True)
class MppiSettings:
    """As published ("NanoBench"; cost and ``prior`` from its released code): 10 steps, 128 rollouts, temperature 0.1,
    noise 0.02 on PWM ratios.

    The cost is position |p - setpoint|^2 + velocity |v|^2 + effort |u|^2 + prior |u - u_cloned|^2.

    ``price``: of the noise against the plan (Williams et al., eq. 19: commands are taken to be about 0). With noise of
    0.02 about a hovering command of 0.8 it outweighs every other cost and pulls the plan to 0 within seconds. The
    released rows show it: their commands are 0.8 off the logged ones (mean square 0.6 to 0.7). 0 takes it away.
    ``first``: PWM ratios that the plan starts from before the first command; released code starts near 0. ``step_s``:
    how long a step of the plan lasts. ``upright``, ``turning``: weights of the tilt 1 - cos and of |rate|^2, zero as
    published.
    """

    horizon: int = 10
    samples: int = 128
    temperature: float = 0.1
    noise: float = 0.02
    position: float = 1.0
    velocity: float = 0.05
    effort: float = 0.01
    prior: float = 2.0
    price: float = 1.0
    first: float = 0.0
    step_s: float = 0.01
    upright: float = 0.0
    turning: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("horizon", "samples", "temperature", "noise", "step_s"):
            if not getattr(self, name) > 0:
                raise UsageError(f"MPPI with {name} {getattr(self, name)}: it has to be above 0")


def improved(plan: Any, noise: Any, cost: Callable[[Any], Any], settings: MppiSettings) -> Any:
    """A better plan (..., T, 4): ``plan`` with ``noise`` (..., K, T, 4) mixed by exp(-cost / temperature).

    cost(commands (..., K, T, 4)) -> (..., K). All arrays of NumPy, or all of JAX.
    """
    xp = np if isinstance(plan, np.ndarray) else libraries().jnp
    middle = plan[..., None, :, :]
    tried = xp.clip(middle + noise, 0.0, 1.0)
    noise = tried - middle
    price = settings.price * settings.temperature * xp.sum(middle * noise, axis=(-2, -1)) / settings.noise**2
    total = cost(tried) + price
    share = xp.exp((total.min(axis=-1, keepdims=True) - total) / settings.temperature)
    share = share / share.sum(axis=-1, keepdims=True)
    return xp.clip(plan + xp.einsum("...k,...ktu->...tu", share, noise), 0.0, 1.0)


def shifted(plan: Any) -> Any:
    """The plan (..., T, 4) one step on."""
    xp = np if isinstance(plan, np.ndarray) else libraries().jnp
    return xp.concatenate([plan[..., 1:, :], plan[..., -1:, :]], axis=-2)
