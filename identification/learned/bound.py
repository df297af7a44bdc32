"""How much better could a simulator predict? A flexible model bounds the gain from any physics.

The correcting network of ``own`` is trained on the simulator's predictions of flights. Whole flights are held out in
turn, and the network corrects those held out. It knows no physics beyond kinematics and uses only the state and the
inputs. So equations of state and inputs could remove the same error. The rest is noise, unlogged moments, or beyond
these flights. The bound is one-sided: equations that generalise better can do more.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from nanobench_tools.errors import InputError
from nanobench_tools.methods import Prediction, Predictor, Windows
from nanobench_tools.metrics.prediction import QUANTITIES
from nanobench_tools.settings import count

from .own import GROUPS, SETTINGS, Flown, train_own
from .training import Settings

QUICK_EPOCHS = count("learned.bound.quick_epochs")
QUICK = replace(SETTINGS, epochs=QUICK_EPOCHS)


@dataclass(frozen=True)
class Bound:
    """Mean errors {quantity: {"1", "10", "50", "sum"}} of flights held out: by the simulator, and with a flexible
    correction; never above the simulator's."""

    simulator: dict[str, dict[str, float]]
    flexible: dict[str, dict[str, float]]
    flights: int
    windows: int

    def share(self, after: dict[str, dict[str, float]], horizon: str = "50") -> dict[str, float]:
        """Fraction of the flexible model's improvement after ``horizon`` steps that ``after`` also achieves, by
        quantity; nan without an improvement."""
        found = {}
        for name, before in self.simulator.items():
            possible = before[horizon] - self.flexible[name][horizon]
            gained = before[horizon] - after[name][horizon]
            found[name] = gained / possible if possible > 0.0 else float("nan")
        return found


def flexible_bound(simulator: Predictor, flights: Sequence[tuple[str, Windows, Prediction]],
                   settings: Settings = QUICK, quiet: bool = True) -> Bound:
    """The bound of a simulator as a predictor, from flights (name, windows, truth) that it was not fitted to. On
    fitted flights the bound describes their remaining error. Raises InputError for fewer than two flights,
    MissingExtraError without JAX."""
    names = list(dict.fromkeys(name for name, _, _ in flights))
    if len(names) < 2:
        raise InputError("flights", f"{len(names)} to bound a simulator with: none can be held out", "give two or more")
    count = min(GROUPS, len(names))
    flown = [Flown(name, windows, came, simulator.predict(windows)) for name, windows, came in flights]
    groups = [[f for f in flown if names.index(f.name) % count == k] for k in range(count)]
    taught = train_own("flexible bound", simulator, groups, False, settings, quiet).trained
    assert taught is not None
    before, after = ({q: getattr(taught.held_out[q], which) for q in QUANTITIES} for which in ("physics", "corrected"))
    return Bound(before, after, len(names), int(np.sum([len(f.windows) for f in flown])))
