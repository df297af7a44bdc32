"""Would the parameters of what was named be better if they were refitted to multi-step predictions?

    python benchmarks/studies/refit_by_prediction.py [--cases 14] [--seed 77]

SYNTHETIC cases (one effect, two effects; both engines where RotorPy is installed). What ``diagnose`` names is fitted
along the measured states. Here the same parameters are then refitted to the errors of position, velocity, attitude and
rate 10 and 50 rows ahead. The fit is robust, each error in units of its size. Flights are left out in turn, and both
predict these. Printed by case: the errors at h = 50 before, after and refitted, and every parameter with its true
value. At the end the median ratio of errors and of parameter errors, by those that push and those that turn.
"""

import argparse

import numpy as np

from identification.mismatch.commanded import believed
from identification.mismatch.diagnosis import judge, recorded
from identification.mismatch.proof import QUANTITIES
from identification.mismatch.refit import refit
from identification.mismatch.space import scales
from identification.mismatch.wrench import Wrench
from identification.prove.blind_proof import plan
from identification.prove.make import Case, make_cases


def one(case: Case) -> tuple[np.ndarray, list[tuple[bool, float, float]]] | None:
    """Ratios (4,) of errors at h = 50, refitted over fitted, and (turns, error of fitted, of refitted) by parameter, in
    scales."""
    recordings = recorded(case.flights, "thrust_voltage" in case.simulator, case.simulator.vehicle)
    simulator = believed(case.simulator, recordings.tracks[0].commanded)
    moments, decision, shown = judge(recordings, Wrench(recordings.tracks), simulator)
    truth = {name: p.value for e in case.truth.effects for name, p in e.parameters.items()}
    print(f"{case.name} ({case.spec.engine}), concealed {[e.term for e in case.truth.effects]}:", end=" ")
    again = refit(moments, decision, shown)
    if isinstance(again, str):
        print(f"{decision.outcome}; {again}")
        return None
    print(f"named {[f.hypothesis.term for f in decision.findings]}{'; the refit is taken' if again.taken else ''}")
    for word, errors in (("before", shown.before), ("after", shown.after), ("refitted", again.compared.after)):
        print(f"  h = 50 {word:9s}" + " ".join(f"{e:7.4f}" for e in errors.mean(axis=0)[-1]))
    sizes = dict(zip(decision.space.model.names, scales(decision.space.model), strict=True))
    beside = []
    for name, new in again.refitted.items():
        value = again.fitted[name]
        print(f"  {name}: fitted {value:.6g}, refitted {new:.6g}" +
              (f", true {truth[name]:.6g}" if name in truth else ""))
        if name in truth:
            turns = all(a.startswith("torque") for f in decision.findings
                        if name.startswith(f.hypothesis.term + ".") for a in f.axes)
            beside.append((turns, abs(value - truth[name]) / sizes[name], abs(new - truth[name]) / sizes[name]))
    return again.compared.after.mean(axis=0)[-1] / shown.after.mean(axis=0)[-1], beside


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
    for k, quantity in enumerate(QUANTITIES):
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
