"""Would the parameters of what was named be better if they were refitted to multi-step predictions?

    python benchmarks/refit_by_prediction.py [--cases 14] [--seed 77]

SYNTHETIC cases (one effect, two effects; both engines where RotorPy is installed). What ``diagnose`` names is fitted
along the measured states. Here the same parameters are then refitted to the errors of position, velocity, attitude and
rate 10 and 50 rows ahead (robust, each in units of its own size), flights left out in turn, and both predict the
flights that were left out. Printed by case: the errors at h = 50 before, after and refitted, and every parameter
beside its true value. At the end the median ratio of errors and of parameter errors, by those that push and those that
turn.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import least_squares

from identification.mismatch import proof
from identification.mismatch.commanded import believed
from identification.mismatch.decide import Decision
from identification.mismatch.diagnose import judge, recorded
from identification.mismatch.fitting import Slopes, fit
from identification.mismatch.moments import Moments
from identification.mismatch.naming import free_of
from identification.mismatch.space import LEVEL, MAPS, scales
from identification.mismatch.track import Track
from identification.mismatch.wrench import Wrench
from identification.prove.make import Case, make_cases
from identification.prove.run import plan
from nanobench_tools import so3
from nanobench_tools.physics import Model

HORIZONS = (10, 50)
STEP = 1e-3
GROUPS = 4 * len(HORIZONS)
EVALUATIONS = 12


def misses(model: Model, track: Track) -> np.ndarray:
    """(windows, 3 GROUPS) errors as vectors."""
    starts = proof._starts(track)
    if not len(starts):
        return np.zeros((0, 3 * GROUPS))
    states, parts = proof._rolled(model, track, starts), []
    for h in HORIZONS:
        end, state = starts + h, states[:, h]
        parts += [state[:, 0:3] - track.position_m[end], state[:, 3:6] - track.velocity_m_s[end],
                  so3.log(so3.multiply(so3.conjugate(state[:, 6:10]), track.quaternion[end])),
                  state[:, 10:13] - track.rate_rad_s[end]]
    return np.clip(np.concatenate(parts, axis=1), -proof.CLIP, proof.CLIP)


@dataclass
class Refit:
    """The parameters of one decision; ``names`` of them, in the model of its space."""

    moments: Moments
    decision: Decision
    terms: list[str] = field(init=False)
    names: list[str] = field(init=False)

    def __post_init__(self) -> None:
        space = self.decision.space
        self.terms = [f.hypothesis.term for f in self.decision.findings]
        self.free = free_of(space, self.terms)
        self.names = [space.model.names[i] for i in self.free]
        self.scale = scales(space.model)[self.free]
        self.whole = bool(set(self.terms) & set(MAPS)) and not set(self.terms) & set(LEVEL)
        self.known = Slopes(self.moments)
        self.tracks = self.moments.wrench.tracks
        self.numbers = sorted({t.flight for t in self.tracks})

    def levels(self, fitted: Model) -> list[Model]:
        """One model a flight."""
        return proof._own_level(self.known, self.decision.space, fitted, self.terms, self.whole)

    def moved(self, model: Model, change: np.ndarray) -> Model:
        return model.with_parameters({
            name: float(np.clip(model.parameters[name] + step * size, *proof._bounds(model, name)))
            for name, step, size in zip(self.names, change, self.scale, strict=True)})

    def best(self, models: list[Model], flights: list[int]) -> np.ndarray:
        """Change of the parameters, in their scales, that predicts these flights best."""
        tracks = [t for t in self.tracks if t.flight in flights]

        def errors(change: np.ndarray) -> np.ndarray:
            return np.concatenate([misses(self.moved(models[self.numbers.index(t.flight)], change), t) for t in tracks])

        start = errors(np.zeros(len(self.names)))
        size = np.repeat(np.sqrt((start**2).reshape(-1, GROUPS, 3).mean(axis=(0, 2))), 3)
        weight = 1.0 / np.where(size > 0.0, size, np.inf)

        def slopes(change: np.ndarray) -> np.ndarray:
            return np.stack([((errors(change + STEP * e) - errors(change - STEP * e)) * weight / (2.0 * STEP)).ravel()
                             for e in np.eye(len(change))], axis=1)

        return least_squares(lambda c: (errors(c) * weight).ravel(), np.zeros(len(self.names)), jac=slopes,
                             loss="soft_l1", max_nfev=EVALUATIONS).x

    def held_out(self) -> np.ndarray:
        """(flights, H, 4) errors as of ``Proof.after``, refitted."""
        found = np.zeros((len(self.numbers), len(proof.HORIZONS), 4))
        for left_out in [self.numbers[k::proof.FOLDS] for k in range(min(proof.FOLDS, len(self.numbers)))]:
            others = [n for n in self.numbers if n not in left_out]
            models = self.levels(fit(Slopes(self.moments, others), self.decision.fit.model, self.free).model)
            change = self.best(models, others)
            for number in left_out:
                k = self.numbers.index(number)
                found[k] = proof._errors(self.moved(models[k], change),
                                         [t for t in self.tracks if t.flight == number], [number])[0]
        return found


def one(case: Case) -> tuple[np.ndarray, list[tuple[bool, float, float]]] | None:
    """Ratios (4,) of errors at h = 50, refitted over fitted, and (turns, error of fitted, of refitted) by parameter, in
    scales."""
    recordings = recorded(case.flights, "thrust_voltage" in case.simulator, case.simulator.vehicle)
    simulator = believed(case.simulator, recordings.tracks[0].commanded)
    moments, decision, shown = judge(recordings, Wrench(recordings.tracks), simulator)
    truth = {name: p["value"] for e in case.truth["effects"] for name, p in e["parameters"].items()}
    print(f"{case.name} ({case.spec.engine}), concealed {[e['term'] for e in case.truth['effects']]}:", end=" ")
    if not decision.findings or decision.own or not shown.held_out:
        print(f"{decision.outcome}, nothing to refit")
        return None
    refit = Refit(moments, decision)
    again = refit.held_out()
    print(f"named {refit.terms}")
    for word, errors in (("before", shown.before), ("after", shown.after), ("refitted", again)):
        print(f"  h = 50 {word:9s}" + " ".join(f"{e:7.4f}" for e in errors.mean(axis=0)[-1]))
    change = refit.best(refit.levels(decision.fit.model), refit.numbers)
    last = refit.moved(decision.fit.model, change).parameters
    beside = []
    for name, size in zip(refit.names, refit.scale, strict=True):
        value, new = decision.fit.model.parameters[name], last[name]
        print(f"  {name}: fitted {value:.6g}, refitted {new:.6g}" +
              (f", true {truth[name]:.6g}" if name in truth else ""))
        if name in truth:
            turns = all(a.startswith("torque") for f in decision.findings
                        if name.startswith(f.hypothesis.term + ".") for a in f.axes)
            beside.append((turns, abs(value - truth[name]) / size, abs(new - truth[name]) / size))
    return again.mean(axis=0)[-1] / shown.after.mean(axis=0)[-1], beside


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=14)
    parser.add_argument("--seed", type=int, default=77)
    options = parser.parse_args()
    try:
        import rotorpy  # noqa: F401
        engine = "both"
    except ImportError:
        engine = "practice"
    found = [one(case) for case in make_cases(plan(options.cases, options.seed, ("single", "pair"), engine))]
    told = [f for f in found if f is not None]
    print(f"\nSYNTHETIC, {len(told)} of {len(found)} cases with a name; refitted over fitted, flights left out, "
          "h = 50, median [10 %, 90 %]:")
    for k, quantity in enumerate(proof.QUANTITIES):
        low, middle, high = np.quantile([f[0][k] for f in told], [0.1, 0.5, 0.9])
        print(f"  {quantity:14s} {middle:.3f} [{low:.3f}, {high:.3f}]")
    for word, turns in (("push", False), ("turn the vehicle", True)):
        errors = np.array([(a, b) for f in told for t, a, b in f[1] if t is turns])
        if len(errors):
            print(f"  parameters that {word}, n = {len(errors)}: median error {np.median(errors[:, 0]):.3f} of their "
                  f"usual size fitted, {np.median(errors[:, 1]):.3f} refitted; largest {errors[:, 0].max():.3f}, "
                  f"{errors[:, 1].max():.3f}")


if __name__ == "__main__":
    main()
