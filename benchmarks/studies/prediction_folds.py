"""What the training flights of Task 1 say of models that were tried: whole flights held out in turn, in five groups.

    python benchmarks/studies/prediction_folds.py [--clock as-recorded|retimed] [--data DIR] [--json FILE]

Rows: the two models of ``nanobench sysid`` that set something per window; ``fit_observed`` with motor lags measured on
rotor speeds (``nanobench motors``, brushed). They are priors and the start of the search.

Also ``fit_observed`` with the constants that would have been best for each window (to first order, learned from the
window itself). That is a bound; the remaining error comes from moments that change within the half second. Then: does
the reaction to rotors that speed up show in yaw? The slope of the yaw error of the model over the change of sum(spin
Omega) since the start would be -J_r / J_z > 0. Test flights are not looked at. Without recordings, practice flights
(SYNTHETIC).
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from prediction_table import COLUMNS, asked, line

from identification.greybox.fit import GreyBox
from identification.greybox.fit_windows import MOST_WINDOWS, Cut, cut, gather
from identification.greybox.fitted_predictor import past_inputs, start_of
from identification.greybox.ladder import FULL
from identification.greybox.residuals import HORIZONS
from identification.greybox.solve import Prior, flown_errors
from nanobench_tools.metrics.prediction import QUANTITIES, multi_horizon, window_errors
from nanobench_tools.physics.model import RATE, ROTOR
from nanobench_tools.physics.rollout import rollout
from nanobench_tools.results import array_fields

GROUPS = 5
MEASURED = (Prior(("motor_lag.tau_up_s",), 0.055, 0.01, "nanobench motors"),
            Prior(("motor_lag.tau_down_s",), 0.119, 0.02, "nanobench motors"),
            Prior(("command_delay.delay_s",), 0.004, 0.004, "nanobench motors"))
LAGS = {"motor_lag": {"tau_up_s": 0.055, "tau_down_s": 0.119}, "command_delay": {"delay_s": 0.005}}
ROWS = {"fit_balanced": GreyBox(FULL, adapt="inputs"), "fit_observed": GreyBox(FULL, adapt="past"),
        "fit_observed, measured lags": GreyBox({**FULL, **LAGS}, adapt="past", soft=MEASURED)}
BOUND = "fit_observed, best constants"
K_F = 2e-8
"""N s^2/rad^2, brushed motors with 46 mm propellers (``nanobench motors``)."""
YAW_AT = (1, 5, 10, 20, 50)


@dataclass
class Scores:
    """Sums of errors over windows, and of yaw errors against changes of the rotors by flight."""

    count: int = 0
    sums: dict[str, np.ndarray] = field(default_factory=dict)
    yaw: list[list[tuple[float, float]]] = field(default_factory=list)

    def add(self, errors: dict[str, np.ndarray]) -> None:
        self.count += len(errors[QUANTITIES[0]])
        for name, error in errors.items():
            self.sums[name] = self.sums.get(name, 0.0) + error.sum(axis=0)

    def row(self) -> dict[str, dict[str, float]]:
        return {name: multi_horizon(total / self.count) for name, total in self.sums.items()}


def groups(cuts: Sequence[Cut]) -> Iterator[tuple[list[Cut], list[Cut]]]:
    """(train, held out) GROUPS times; train is thinned as a fit thins it."""
    for group in range(GROUPS):
        kept = [c for i, c in enumerate(cuts) if i % GROUPS != group]
        thin = max(1, round(sum(len(c.windows) for c in kept) / MOST_WINDOWS))
        every = [slice(i % thin, None, thin) for i in range(len(kept))]
        yield ([Cut(c.name, array_fields.rows(c.windows, keep), array_fields.rows(c.came, keep), thin)
                for c, keep in zip(kept, every, strict=True)], [c for i, c in enumerate(cuts) if i % GROUPS == group])


def best_constants(fitted: GreyBox, c: Cut) -> dict[str, np.ndarray]:
    """Errors at HORIZONS with the nuisances of every window chosen from the window itself."""
    made = fitted.predictor_
    nuisances, model = made.nuisances_, made.model
    spread = np.array([n.sd for n in nuisances])
    directions = [np.array([of(n) for n in nuisances]).T * spread for of in (lambda n: n.vector(model),
                                                                            lambda n: n.start())]
    problem = replace(fitted.solution_.problem, data=gather([c]), nuisances=(), model=model)
    parts = [(e, s) for _, e, s in flown_errors(problem, model.values, np.zeros((1, 0)), *directions)]
    found, slopes = (np.concatenate(part) for part in zip(*parts, strict=True))
    usual = np.asarray(made.scale)[..., None]
    e = (found / usual).reshape(len(found), -1)
    s = (slopes / usual[..., None]).reshape(len(found), -1, len(nuisances))
    matrix = s.transpose(0, 2, 1) @ s + 0.01 * np.eye(len(nuisances))
    own = -np.linalg.solve(matrix, np.einsum("nrA,nr->nA", s, e)[..., None])[..., 0]
    left = np.linalg.norm(found + np.einsum("nkgcA,nA->nkgc", slopes, own), axis=-1)
    return {name: left[:, :, i] for i, name in enumerate(QUANTITIES)}


def yaw_against_rotors(fitted: GreyBox, c: Cut) -> list[tuple[float, float]]:
    """[(slope, correlation)] of the yaw error over the change of sum(spin Omega), after YAW_AT steps."""
    model = fitted.model_
    states = rollout(model, start_of(c.windows), c.windows.motor, c.windows.battery_V, past_inputs(c.windows),
                     row_hz=c.windows.rate_hz)
    turning = np.sqrt(np.maximum(states[..., ROTOR], 0.0) / K_F) @ np.array(model.vehicle.spin)
    found = []
    for h in YAW_AT:
        error = c.came.rate_rad_s[:, h - 1, 2] - states[:, h, RATE][:, 2]
        change = turning[:, h] - turning[:, 0]
        found.append((float(np.polyfit(change, error, 1)[0]), float(np.corrcoef(change, error)[0, 1])))
    return found


def main() -> None:
    args, split, word = asked(__doc__)
    cuts = cut(split.train, past=True, thin=1)
    scores = {name: Scores() for name in (*ROWS, BOUND)}
    for train, held_out in groups(cuts):
        for name, settings in ROWS.items():
            fitted = replace(settings).fit_cuts(train)
            for c in held_out:
                scores[name].add(window_errors(fitted.predict(c.windows), c.came))
                if name == "fit_observed":
                    scores[BOUND].add(best_constants(fitted, c))
                    scores[BOUND].yaw.append(yaw_against_rotors(fitted, c))
    print(f"{len(cuts)} {word} training flights held out in {GROUPS} groups, {scores['fit_observed'].count} windows, "
          f"clock {args.clock}: {COLUMNS}")
    rows = {name: scores[name].row() for name in ROWS}
    at = [int(np.flatnonzero(h == HORIZONS)[0]) for h in (1, 10, 50)]
    rows[BOUND] = {q: dict(zip(("1", "10", "50"), (scores[BOUND].sums[q] / scores[BOUND].count)[at].tolist(),
                               strict=True)) for q in QUANTITIES}
    for name, row in rows.items():
        print(line(name, row))
    yaw = np.array(scores[BOUND].yaw)
    for i, h in enumerate(YAW_AT):
        slope, correlation = yaw[:, i].T
        print(f"yaw error after {h} steps over the change of sum(spin Omega): median slope {np.median(slope):+.1e}, "
              f"correlation {np.median(correlation):+.2f}, slope above 0 in {np.sum(slope > 0)} of {len(yaw)} flights")
    if args.json:
        args.json.write_text(json.dumps({"rows": rows, "yaw": yaw.tolist()}))


if __name__ == "__main__":
    main()
