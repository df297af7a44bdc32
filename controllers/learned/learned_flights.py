"""Learned controllers on an ensemble of plants, as items of the runner; and policies corrected by their teacher."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from controllers.onboard_pid import OnboardPid
from controllers.plants.closed_loop import Flown
from controllers.plants.ensemble import draw
from controllers.plants.simulated_flights import flown
from nanobench_tools.errors import UsageError
from nanobench_tools.methods import Controller, Reference, VehicleState
from nanobench_tools.physics.simulator import loads
from nanobench_tools.practice.references import PathSpec
from nanobench_tools.protocols.simulated import LOST_M, TICK_S, Paths, Runs, score
from nanobench_tools.settings import number

from .demonstrations import Demonstration, Shown
from .pilots import PERIOD_S, ClonedPolicy, Mppi, MppiFar, MppiLearned, observation
from .policies import SETTINGS, Network, trained

PILOTS = ("bc_mlp", "bc_lstm", "mppi_learned", "mppi", "mppi_far")
Draws = tuple[tuple[str, ...], list[list[float]]] | None


def pilot_of(name: str, networks: Mapping[str, Network], simulator: str,
             gains: Mapping[str, float] | None = None) -> Controller:
    """One of PILOTS, or a corrected policy by the name of its network; ``gains`` for one that has some. UsageError for
    another name."""
    if name in networks and networks[name].kind != "dynamics":
        return ClonedPolicy(networks[name], name)
    if name == "mppi_learned":
        return MppiLearned(dict(networks))
    kinds = {"mppi": Mppi, "mppi_far": MppiFar}
    if name not in kinds:
        raise UsageError(f"unknown learned controller {name!r}; known: {', '.join(PILOTS)}")
    return kinds[name](loads(simulator), gains)


def fly_learned(name: str, networks: Mapping[str, Network], specs: Sequence[PathSpec], simulator: str, plants: int,
                seed: int = 0, draws: Draws = None, gains: Mapping[str, float] | None = None) -> Runs:
    """As ``simulated_flights.fly_controller``; the scores with ``kept_s``. That is how long a vehicle stayed within
    LOST_M of the path, take-over included."""
    ensemble = draw(simulator, plants, seed, None if draws is None else (tuple(draws[0]), np.array(draws[1], float)))
    controller, paths = pilot_of(name, networks, simulator, gains), Paths(tuple(specs))
    found = flown(controller, paths, ensemble)
    runs = score(found, paths, len(ensemble), controller.period_s)
    for k, path in enumerate(runs):
        for one, seconds in zip(path, kept_s(found, paths, k, len(ensemble)), strict=True):
            one["kept_s"] = float(seconds)
    return Runs(f"{name} tuned" if gains is not None else name, controller.information, runs)


def kept_s(found: Flown, paths: Paths, path: int, plants: int) -> np.ndarray:
    """(plants,) s from the first command until a vehicle was LOST_M away, or the whole flight."""
    rows = paths.scored(path).stop
    mine = found.position_m[:rows, path * plants:(path + 1) * plants]
    off = np.linalg.norm(mine - paths.all[0][:rows, None, path], axis=2)
    return np.asarray(TICK_S * np.minimum.accumulate(off <= LOST_M, axis=0).sum(axis=0))


class Corrected:
    """A policy flies while its teacher, the onboard PID, records at every tick what it would have commanded. The
    teacher himself flies a share ``teacher_share`` of the vehicles (S. Ross et al., DAgger, 2011)."""

    information = "as flown"
    on_board = True
    name = "dagger"
    period_s = OnboardPid.period_s

    def __init__(self, policy: ClonedPolicy, teacher_share: float) -> None:
        self.policy, self.teacher, self.share = policy, OnboardPid(), teacher_share

    def reset(self, n: int) -> None:
        self.policy.reset(n)
        self.teacher.reset(n)
        self.taught = np.arange(n) < round(self.share * n)
        self.seen: list[np.ndarray] = []
        self.taught_commands: list[np.ndarray] = []
        self._calls = 0

    def command(self, time_s: float, state: VehicleState, reference: Reference) -> np.ndarray:
        """PWM ratios (n, 4)."""
        taught_commands = self.teacher.command(time_s, state, reference)
        if self._calls % round(PERIOD_S / self.period_s) == 0:
            self._own = self.policy.command(time_s, state, reference)
            self.seen.append(observation(state, reference))
            self.taught_commands.append(taught_commands)
        self._calls += 1
        return np.where(self.taught[:, None], taught_commands, self._own)


NEAR_M = number("control.learned_flights.near_m")


def corrected(kind: str, shown: Shown, network: Network, specs: Sequence[PathSpec], simulator: str, rounds: int,
              plants: int = 6, seed: int = 0, draws: Draws = None, folder: Path | None = None,
              quiet: bool = True) -> Network:
    """A policy after ``rounds`` of flying plants and learning what its teacher would have done there, added to what it
    was shown. The teacher flies all vehicles in the first round, fewer in each, none in the last."""
    known = None if draws is None else (tuple(draws[0]), np.array(draws[1], float))
    extra: list[Demonstration] = []
    for k in range(rounds):
        ensemble = draw(simulator, plants, seed + 7919 * (k + 1), known)
        share = 1.0 - k / max(rounds - 1, 1) if rounds > 1 else 0.5
        both = Corrected(ClonedPolicy(network), share)
        flown(both, Paths(tuple(specs)), ensemble)
        extra += _taught(both, k)
        network = trained(kind, shown, replace(SETTINGS[kind], seed=seed), folder, quiet, extra,
                          f"{kind}_dagger_{k + 1}_of_{rounds}")
    return network


def _taught(both: Corrected, number: int) -> list[Demonstration]:
    """What every vehicle saw until it was lost, and what the teacher said."""
    seen, taught_commands = np.stack(both.seen, axis=1), np.stack(both.taught_commands, axis=1)
    found = []
    for i, (rows, commands) in enumerate(zip(seen, taught_commands, strict=True)):
        off = np.linalg.norm(rows[:, :3] - rows[:, 10:13], axis=1)
        lost = np.flatnonzero(~(off < NEAR_M))
        end = int(lost[0]) if len(lost) else len(rows)
        if end > 100:
            found.append(Demonstration(f"round {number + 1} vehicle {i + 1}", "pid", "plant",
                                       rows[:end].astype(np.float32), commands[:end].astype(np.float32),
                                       rows[:end, :6], (end,)))
    return found
