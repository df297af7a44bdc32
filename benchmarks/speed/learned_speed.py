"""Prediction time of learned models, in this process: 1,000 windows of 50 steps, the first call (which compiles) and
the median of ten more. Both as wall clock and as processor time, which other work does not lengthen. The published
physics in NumPy is the reference; the networks also run in PyTorch if it is installed. Then a plan of MPPI: 512
rollouts of 0.5 s on the shipped plant's equations, for each of 12 vehicles.

    python benchmarks/speed/learned_speed.py [--windows 1000] [--repeat 10]

Windows are made up (SYNTHETIC) and networks untrained: the time depends on neither.
"""

import argparse
import importlib.util
import itertools
import time

import numpy as np
from kept import show

from controllers.learned.pilots import MppiFar
from controllers.plants.ensemble import shipped_simulator
from identification.learned.libraries import libraries, platform
from identification.learned.networks import DEPTH, KINDS, WIDTH, network
from identification.learned.published_networks import LearnedPredictor, row_name
from identification.published_physics import PublishedPhysics
from nanobench_tools import so3
from nanobench_tools.methods import Reference, VehicleState, Windows
from nanobench_tools.physics.simulator import loads

HORIZON = 50
AIM_S = 0.2


def made_windows(n: int) -> Windows:
    """n windows about hover."""
    rng = np.random.default_rng(0)
    return Windows(rng.normal(size=(n, 3)), rng.normal(size=(n, 3)), so3.exp(0.1 * rng.normal(size=(n, 3))),
                   0.3 * rng.normal(size=(n, 3)), rng.uniform(0.6, 0.9, (n, HORIZON, 4)), np.full((n, HORIZON), 3.6))


def seconds(run, repeat: int) -> tuple[float, float, float]:
    """(of the first call, median of the others, median of processor time of the others)."""
    taken = []
    for _ in range(repeat + 1):
        before = time.perf_counter(), time.process_time()
        run()
        taken.append((time.perf_counter() - before[0], time.process_time() - before[1]))
    middle = np.median(taken[1:], axis=0)
    return taken[0][0], float(middle[0]), float(middle[1])


def in_torch(n: int):
    """The residual MLP rolled out in PyTorch, on one thread."""
    import torch

    torch.set_num_threads(1)
    sizes = [16, *[WIDTH] * DEPTH]
    layers = [part for a, b in itertools.pairwise(sizes) for part in (torch.nn.Linear(a, b), torch.nn.ReLU())]
    made = torch.nn.Sequential(*layers, torch.nn.Linear(WIDTH, 12))
    start, inputs = torch.randn(n, 12), torch.randn(n, HORIZON, 4)

    def run():
        with torch.no_grad():
            x = start
            for k in range(HORIZON):
                x = x + made(torch.cat([x, inputs[:, k]], dim=1))

    return run


def planned(vehicles: int = 12):
    """A command of ``MppiFar`` for so many vehicles that hover."""
    pilot = MppiFar(loads(shipped_simulator()))
    pilot.reset(vehicles)
    zero = np.zeros((vehicles, 3))
    state = VehicleState(zero, zero, np.tile([0.0, 0.0, 0.0, 1.0], (vehicles, 1)), zero, np.full(vehicles, 3.6))
    reference = Reference(zero, np.zeros(vehicles), zero, zero)
    return lambda: pilot.command(0.0, state, reference)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--windows", type=int, default=1000)
    parser.add_argument("--repeat", type=int, default=10)
    args = parser.parse_args()
    windows = made_windows(args.windows)
    scaling = (np.zeros(12), np.ones(12), np.zeros(4), np.ones(4))
    leaves = {kind: tuple(np.asarray(leaf) for leaf in libraries().jax.tree.leaves(network(kind, False, scaling, 0))
                          if hasattr(leaf, "shape")) for kind in KINDS}
    print(f"{args.windows} windows of {HORIZON} steps, {platform()}, SYNTHETIC: first call s, median s, median of "
          f"processor time s, aim {AIM_S} s")
    rows = {row_name(kind, False): LearnedPredictor(kind, kind, False, leaves[kind], scaling) for kind in KINDS}
    spent: dict[str, float] = {}
    for name, predictor in {"published_physics (NumPy)": PublishedPhysics(), **rows}.items():
        first, median, work = seconds(lambda p=predictor: p.predict(windows), args.repeat)
        print(f"{name:<28} {first:8.3f} {median:8.4f} {work:8.4f}{'' if median < AIM_S else '   MISSED'}")
        spent[name] = work
    physics, *others = spent
    for name in others:
        show(f"{physics} / {name}", spent[physics] / spent[name], args.repeat)
    if importlib.util.find_spec("torch") is not None:
        first, median, work = seconds(in_torch(args.windows), args.repeat)
        print(f"{'residual_mlp (PyTorch)':<28} {first:8.3f} {median:8.4f} {work:8.4f}")
    else:
        print("residual_mlp (PyTorch)       not installed")
    first, median, work = seconds(planned(), args.repeat)
    print(f"{'MPPI, one plan of 12':<28} {first:8.3f} {median:8.4f} {work:8.4f}")


if __name__ == "__main__":
    main()
