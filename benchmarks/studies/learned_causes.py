"""Why learned rows differ from published ones, and networks alone from physics: one cause at a time, measured.

    python benchmarks/studies/learned_causes.py flights [--data DIR] [--checkpoints DIR] [--mppi] [--json FILE]
    python benchmarks/studies/learned_causes.py inputs [--data DIR] [--epochs 60] [--json FILE]

``flights`` (Task 2): the released table has every flight on learned dynamics (task2_closed_loop_metrics_per_traj.csv
of the "NanoBench" release). Those of its recordings that are here, recognised by least and mean battery voltage, are
flown by two policies. Policy (a) is trained on flights of the onboard PID, without the medium trefoil and without
these recordings, as ``nanobench control`` trains; (b) flights of all pilots, without these recordings; (c) all
flights, these too: no longer held out, which says what having seen them would be worth. Each flies on dynamics learnt
from the same flights.

``inputs`` (Task 1): the residual MLP with fewer training flights, and without position among its inputs. Also a
constant state on windows of whole recordings, ground included, which shows how hard the published windows are. Errors
of position after 50 steps on the test flights.
"""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from controllers.learned.demonstrations import HELD_OUT, TEACHER, Demonstration, Shown, demonstrations
from controllers.learned.policies import KINDS, trained
from controllers.learned.rollouts import rolled, score
from identification.learned.libraries import libraries
from identification.learned.published_networks import predictor_of, task_of
from identification.learned.training import Settings, filled, train
from identification.learned.training_rows import rows_of
from identification.naive import Naive
from nanobench_tools.flight import Flight
from nanobench_tools.methods import Predictor
from nanobench_tools.metrics.prediction import QUANTITIES, window_errors
from nanobench_tools.metrics.statistics import bootstrap_ratio
from nanobench_tools.protocols import task1
from nanobench_tools.protocols.phases import MOTOR_ON
from nanobench_tools.protocols.task2 import PUBLISHED
from nanobench_tools.protocols.windows import cut_windows
from nanobench_tools.results.result_files import write_json
from nanobench_tools.steps.options import Options


@dataclass(frozen=True)
class Released:
    """One flight of the released table: mean and least battery voltage [V], RMSE [m] by pilot."""

    name: str
    mean_V: float
    least_V: float
    rmse_m: dict[str, float]


def _released(name: str, mean_V: float, least_V: float, *rmse_m: float) -> Released:
    return Released(name, mean_V, least_V, dict(zip(("bc_mlp", "bc_lstm", "mppi"), rmse_m, strict=True)))


RELEASED = (_released("B5_helix_fast_rep01", 3.35421, 3.21875, 0.6719, 0.6400, 1.0770),
            _released("B5_helix_slow_rep01", 3.47333, 3.35395, 0.4817, 0.4045, 0.7172),
            _released("B7_oval_medium_rep01", 3.45422, 3.30329, 0.5688, 0.1959, 1.2545),
            _released("B8_star_medium_rep01", 3.58249, 3.34189, 0.2059, 0.2036, 0.9471),
            _released("B8_star_slow_rep01", 3.63132, 3.53138, 0.3175, 0.2823, 1.3561),
            _released("B7_oval_fast_rep01", 3.31995, 3.14611, 0.3850, 0.3530, 0.9715),
            _released("B9_trefoil_medium_rep01", 3.68010, 3.56366, 0.1469, 0.1809, 1.3153),
            _released("B2_circle_slow_rep01", 3.38508, 3.27729, 0.6587, 0.7296, 0.9471),
            _released("B3_figure8_medium_rep01", 3.30614, 3.09128, 1.0128, 0.9545, 1.0684),
            _released("B5_helix_medium_rep01", 3.30051, 3.16385, 0.9413, 0.8515, 0.9356))
SAME_V = 2e-5, 0.02
"""Least and mean voltages of the same recording differ by less (the mean is over rows that are chosen differently)."""


def battery(flight: Flight) -> tuple[float, float]:
    """Mean and least battery voltage [V] over the rows with motors on."""
    motor = flight["motor"]
    volts = flight["battery"].interpolate("vbat", motor.time_s[motor["m1"] > MOTOR_ON])
    return (float(volts.mean()), float(volts.min())) if len(volts) else (np.nan, np.nan)


def recognised(flights: Sequence[Flight]) -> dict[str, Released]:
    """Released flights by the name of the recording that has their voltages, if exactly one does."""
    known = {f.name: battery(f) for f in flights if "motor" in f and "battery" in f}
    found = {}
    for released in RELEASED:
        near = [name for name, (mean, least) in known.items()
                if abs(least - released.least_V) < SAME_V[0] and abs(mean - released.mean_V) < SAME_V[1]]
        if len(near) == 1:
            found[near[0]] = released
    return found


def sets(found: Sequence[Demonstration], judged: Sequence[Demonstration], seed: int) -> dict[str, Shown]:
    """What trains, by name; a share of it, whole flights, validates."""
    names = {d.name for d in judged}
    others = [d for d in found if d.name not in names]
    reference = " ".join(PUBLISHED)
    pools = {"(a) PID": [d for d in others if d.controller == TEACHER and d.reference != reference],
             "(b) all pilots": others, "(c) these too": list(found)}
    shown = {}
    for name, pool in pools.items():
        order = np.random.default_rng(seed).permutation(len(pool))
        count = max(1, round(HELD_OUT * len(pool)))
        shown[name] = Shown([pool[i] for i in order[count:]], [pool[i] for i in order[:count]], list(judged))
    return shown


def flights_part(options: Options, folder: Path | None, with_mppi: bool) -> dict[str, Any]:
    """Prints and returns the rows of ``flights``."""
    flights = options.load()
    audits, _ = options.audit(flights)
    found = demonstrations(flights, audits)
    here = recognised([f for f in flights if f.name in {d.name for d in found}])
    judged = [d for d in found if d.name in here]
    pilots = ("bc_mlp", "bc_lstm", *(("mppi",) if with_mppi else ()))
    print(f"{len(judged)} of {len(RELEASED)} released flights are here: "
          + ", ".join(f"{here[d.name].name} ({d.controller})" for d in judged))
    rows: dict[str, Any] = {}
    for name, shown in sets(found, judged, options.seed).items():
        own = None if folder is None else folder / name[1]
        networks = {kind: trained(kind, shown, None, own, options.quiet) for kind in KINDS}
        for pilot in pilots:
            scores = [score(states, d) for states, d in zip(rolled(pilot, networks, judged), judged, strict=True)]
            rows[f"{pilot} {name}"] = show(pilot, name, len(shown.train), [here[d.name] for d in judged], scores)
    return rows


def show(pilot: str, name: str, trained_on: int, released: Sequence[Released],
         scores: Sequence[dict[str, float]]) -> dict[str, Any]:
    """One line: means over the same flights, their ratio with a 95 % interval (flights drawn), the published flight."""
    ours, theirs = np.array([s["rmse_m"] for s in scores]), np.array([r.rmse_m[pilot] for r in released])
    drawn = bootstrap_ratio(ours, theirs)
    one = next((i for i, r in enumerate(released) if r.name == "B9_trefoil_medium_rep01"), None)
    cell = "" if one is None else f"; the published flight {ours[one]:.3f} m (published {theirs[one]:.3f})"
    low, high = (np.nan, np.nan) if drawn is None else drawn
    print(f"{pilot:<8} {name:<15} {trained_on} flights train: RMSE {ours.mean():.3f} m over {len(ours)} flights, "
          f"published {theirs.mean():.3f}, ratio {ours.mean() / theirs.mean():.2f} ({low:.2f} .. {high:.2f}), flown "
          f"{np.mean([s['valid_percent'] for s in scores]):.0f} %{cell}", flush=True)
    return {"rmse_m": ours, "published_m": theirs, "flights": [r.name for r in released], "mean_m": ours.mean(),
            "published_mean_m": theirs.mean(), "ratio": ours.mean() / theirs.mean(), "ci95": [low, high],
            "cell_m": None if one is None else ours[one], "cell_published_m": None if one is None else theirs[one],
            "trained_on": trained_on}


def blind(network: Any) -> Any:
    """The residual MLP that cannot see position: its weights of it are nought."""
    with_jax = libraries()
    weight = network.mlp.layers[0].weight
    return with_jax.eqx.tree_at(lambda n: n.mlp.layers[0].weight, network, weight.at[:, :3].set(0.0))


def residual_mlp(cases: Sequence[task1.Case], settings: Settings, seen: Callable[[Any], Any] | None = None) -> Any:
    """The trained row; ``seen`` changes the network before it is used."""
    rows = rows_of(cases)
    task, _ = task_of("residual_mlp", False, rows, settings.seed)
    if seen is not None:
        loss = task.loss
        task = replace(task, loss=lambda network, data, starts: loss(seen(network), data, starts))
    found = train(task, settings)
    if seen is not None:
        eqx, jax = libraries().eqx, libraries().jax
        changed = jax.tree.leaves(eqx.filter(seen(filled(task.network, found.leaves)), eqx.is_inexact_array))
        found = replace(found, leaves=[np.asarray(leaf) for leaf in changed])
    return predictor_of("residual_mlp", False, rows, found)


def errors(predictor: Predictor, cases: Sequence[task1.Case]) -> tuple[np.ndarray, np.ndarray]:
    """(sums (n,) m of position errors after 50 steps by flight, windows behind them (n,))."""
    sums, counts = [], []
    for case in cases:
        cut = cut_windows(case.flight, case.spans, "onboard")
        if cut is not None:
            after = window_errors(predictor.predict(cut[0]), cut[1])[QUANTITIES[0]][:, -1]
            sums.append(after.sum())
            counts.append(len(after))
    return np.array(sums), np.array(counts)


def inputs_part(options: Options, epochs: int) -> dict[str, Any]:
    """Prints and returns the rows of ``inputs``."""
    flights = options.load()
    audits, _ = options.audit(flights)
    split = task1.split(flights, audits)
    order = np.random.default_rng(options.seed).permutation(len(split.train))
    whole = [task1.Case(case.flight, (case.flight.span,), ()) for case in split.test]
    settings = Settings(epochs=epochs, seed=options.seed)
    rows = {}

    def line(name: str, predictor: Predictor, cases: Sequence[task1.Case]) -> None:
        sums, counts = errors(predictor, cases)
        mean = float(sums.sum() / counts.sum())
        labels = options.sessions.labels(case.flight for case in cases) if len(sums) == len(cases) else None
        low, high = bootstrap_ratio(sums, counts, sessions=labels) or (np.nan, np.nan)
        best = getattr(predictor, "trained", {}).get("best_epoch")
        print(f"{name:<58} {mean:.4f} m ({low:.4f} .. {high:.4f}), n = {len(sums)} flights, {int(counts.sum())} windows"
              + (f", best epoch {best} of {epochs}" if best else ""), flush=True)
        rows[name] = {"position_50_m": mean, "ci95": [float(low), float(high)], "best_epoch": best}

    line("standing still, windows in clean flight", Naive(), split.test)
    line("standing still, windows of whole recordings", Naive(), whole)
    counts = dict.fromkeys((max(2, len(order) // 3), max(2, 2 * len(order) // 3), len(order)))
    for count in counts:
        some = [split.train[i] for i in sorted(order[:count])]
        line(f"residual MLP, {count} training flights", residual_mlp(some, settings), split.test)
    line(f"residual MLP, {len(order)} training flights, sees no position", residual_mlp(split.train, settings, blind),
         split.test)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("part", choices=["flights", "inputs"])
    parser.add_argument("--data", type=Path, nargs="*", default=())
    parser.add_argument("--checkpoints", type=Path, help="Keep trainings here; a killed run goes on.")
    parser.add_argument("--mppi", action="store_true", help="Fly MPPI, too (minutes per flight).")
    parser.add_argument("--epochs", type=int, default=60, help="Of the residual MLP.")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    libraries()
    options = Options(data=tuple(args.data), seed=args.seed)
    rows = (flights_part(options, args.checkpoints, args.mppi) if args.part == "flights"
            else inputs_part(options, args.epochs))
    print("SYNTHETIC flights" if options.synthetic else "real flights")
    if args.json:
        write_json(args.json, rows)


if __name__ == "__main__":
    main()
