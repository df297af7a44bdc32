"""Search for gains on an ensemble of plants, tested on unseen plants and paths.

The covariance matrix adaptation evolution strategy proposes the logarithms of the gains and minimises ``objective``.
Source: Hansen, Ostermeier 2001, doi:10.1162/106365601750190398; package ``cma``. Half of the plants have a radio that
is later than controllers assume. The best few and the original gains then fly on other plants, the same paths, and the
best there is chosen. The reason: the best of many on a few plants partly fits just these.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from nanobench_tools.errors import MissingExtraError
from nanobench_tools.metrics.statistics import draws
from nanobench_tools.physics.simulator import loads
from nanobench_tools.practice.references import PathSpec
from nanobench_tools.protocols.simulated import Paths, score
from nanobench_tools.results.result import Result
from nanobench_tools.settings import count, number

from .gains import Gain
from .plants.ensemble import Ensemble, draw
from .plants.off_nominal import LATE_S
from .plants.simulated_flights import flown, made


@dataclass(frozen=True, repr=False)
class Flown(Result):
    """Results of a controller on every path (outer) with every plant (inner). They are RMSE and RMSE across the path
    [m], None without one, and whether the vehicle was lost."""

    rmse_m: Sequence[Sequence[float | None]]
    contour_m: Sequence[Sequence[float | None]]
    lost: Sequence[Sequence[bool]]


@dataclass(frozen=True, repr=False)
class Trial(Result):
    """Gains, and the ``objective`` with them."""

    gains: Mapping[str, float]
    objective: float


@dataclass(frozen=True, repr=False)
class Compared(Result):
    """ratio: geometric mean of RMSE after over before, with its interval; how many vehicles were lost, of how many
    paths and plants."""

    ratio: float
    ci95: tuple[float, float]
    better: bool
    lost_before: int
    lost_after: int
    paths: int
    plants: int


LOST_M = 4.0
STEP = number("control.tuning.step")
WORST = number("control.tuning.worst")
SHORT = count("control.tuning.short")
DRAWN = 4000
SHARE = 0.95


def plants_of(simulator: str, plants: int, seed: int, radio_s: float,
              draws: tuple[tuple[str, ...], np.ndarray] | None = None) -> Ensemble:
    """Plants of ``draw``; the radio of every second one is LATE_S later than controllers assume."""
    crowd = draw(simulator, plants, seed, draws, radio_s)
    return replace(crowd, radio_s=radio_s + LATE_S * (np.arange(plants) % 2))


def evaluate(name: str, gains: Mapping[str, float], specs: Sequence[PathSpec], simulator: str, plants: int, seed: int,
             radio_s: float, draws: tuple[tuple[str, ...], list[list[float]]] | None = None) -> Flown:
    """Of a controller with these gains."""
    known = None if draws is None else (tuple(draws[0]), np.array(draws[1], float))
    crowd = plants_of(simulator, plants, seed, radio_s, known)
    controller, paths = made(name, loads(simulator), radio_s, gains), Paths(tuple(specs))
    runs = score(flown(controller, paths, crowd), paths, plants, controller.period_s)
    return Flown([[one["rmse_m"] for one in path] for path in runs],
                 [[one["contour_rmse_m"] for one in path] for path in runs],
                 [[one["lost_percent"] > 0.0 for one in path] for path in runs])


def logs(found: Flown) -> np.ndarray:
    """(paths, plants) logarithm of the RMSE, LOST_M for a vehicle that is lost."""
    rmse = np.nan_to_num(np.array(found.rmse_m, float), nan=LOST_M)
    return np.asarray(np.log(np.clip(np.where(np.array(found.lost, bool), LOST_M, rmse), 1e-4, LOST_M)))


def objective(found: Flown) -> float:
    """Mean of the logarithms of the RMSE, and of those of the WORST flights, half each."""
    sorted_logs = np.sort(logs(found).ravel())
    worst = sorted_logs[-max(round(WORST * len(sorted_logs)), 1):]
    return float(0.5 * (sorted_logs.mean() + worst.mean()))


def shortlist(trials: Sequence[Trial]) -> list[dict[str, float]]:
    """The gains as they were (the first trial), then the SHORT best that are less than those, best first."""
    better = sorted((t for t in trials[1:] if t.objective < trials[0].objective), key=lambda t: t.objective)
    return [dict(trial.gains) for trial in [trials[0], *better[:SHORT]]]


def search(tunable: Mapping[str, Gain], run: Callable[[list[dict[str, float]]], list[float]], budget: int,
           seed: int) -> list[Trial]:
    """Every trial of about ``budget`` trials; ``run`` gives objectives of candidates.

    The first trial is the values as they are. The same seed proposes the same, so that a search whose trials are kept
    goes on where it was killed. Raises MissingExtraError without ``cma``.
    """
    try:
        import cma
    except ImportError:
        raise MissingExtraError("cma", "tune") from None
    names = list(tunable)
    low, high = (np.log([getattr(tunable[n], end) for n in names]) for end in ("low", "high"))
    start = {n: tunable[n].value for n in names}
    trials = [Trial(start, run([start])[0])]
    middle = (np.log([tunable[n].value for n in names]) - low) / (high - low)
    # its seed 0 would mean the clock
    found = cma.CMAEvolutionStrategy(middle, STEP, {"bounds": [0.0, 1.0], "seed": seed + 1, "verbose": -9})
    while len(trials) < budget:
        candidates = found.ask()[:budget - len(trials)]
        many = [dict(zip(names, np.exp(low + x * (high - low)).round(8).tolist(), strict=True)) for x in candidates]
        objectives = run(many)
        trials += map(Trial, many, objectives)
        if len(trials) < budget:
            found.tell(candidates, objectives)
    return trials


def compared(before: Flown, after: Flown, seed: int = 0) -> Compared:
    """Whether ``after`` is better, on the same paths and plants. The interval draws paths and plants anew, both whole
    (Owen 2007, doi:10.1214/07-AOAS122). Better means all of it below 1 and no more vehicles lost."""
    change = logs(after) - logs(before)
    paths, plants = change.shape
    drawn = (draws(tuple(range(many)), own, DRAWN) for many, own in ((paths, seed), (plants, seed + 1)))
    means = np.einsum("dp,dq,pq->d", *drawn, change) / change.size
    ends = np.exp(np.quantile(means, [0.5 - SHARE / 2, 0.5 + SHARE / 2]))
    lost_before, lost_after = (int(np.sum(np.array(found.lost, bool))) for found in (before, after))
    return Compared(float(np.exp(change.mean())), (float(ends[0]), float(ends[1])),
                    bool(ends[1] < 1.0) and lost_after <= lost_before,
                    lost_before, lost_after, paths, plants)
