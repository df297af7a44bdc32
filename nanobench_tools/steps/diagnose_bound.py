"""``nanobench diagnose --bound``: how much better could anything predict these flights? A network in addition to the
identified effects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..methods import Prediction, Predictor, Windows
from ..metrics.prediction import HORIZONS, QUANTITIES, window_errors
from ..results.result import Result
from .options import Options

if TYPE_CHECKING:
    from identification.mismatch.recordings import Recordings
    from identification.mismatch.verdict import Verdict

    from ..physics import Model

QUADROTOR = 4
GIVEN = ("start state, inputs of the window and of the half second before; the network saw the other flights, the "
         "corrected simulator all of them")


Errors = Mapping[str, Mapping[str, float]]
"""{quantity: {"1", "10", "50", "sum"}}: mean errors over all windows."""


@dataclass(frozen=True, repr=False)
class Bound(Result):
    """Errors of the simulator alone, with a network and with the identified effects, over so many flights and windows;
    ``share``: of what the network takes away, what the names do, None where it takes away nothing."""

    flights: int
    windows: int
    given: str
    simulator: Errors
    flexible: Errors
    corrected: Errors
    share: Mapping[str, float | None]
    sentence: str


def flexible(options: Options, verdict: Verdict, recordings: Recordings, simulator: Model) -> Bound | None:
    """None where too few flights can be predicted, with a message."""
    from identification.greybox.fit_windows import cut
    from identification.learned.bound import flexible_bound

    from ..physics.predictor import ModelPredictor
    from ..protocols.task1 import training_cases

    if simulator.rotors != QUADROTOR or any(track.commanded for track in recordings.tracks):
        options.say("--bound: the network is fed with four motors, which these flights do not have")
        return None
    cases = training_cases(recordings.flights, recordings.audits)
    flights = [(c.name, c.windows, c.came) for c in cut(cases)]
    options.say(f"--bound: a network is trained on what the simulator leaves in {len(flights)} flights")
    try:
        before = ModelPredictor(verdict.believed or simulator)
        bound = flexible_bound(before, flights)
    except InputError as error:
        options.say(f"--bound: {error}")
        return None
    after = before if verdict.corrected is None else ModelPredictor(verdict.corrected)
    found = errors_of(after, flights)
    share = {q: None if not np.isfinite(s) else s for q, s in bound.share(found).items()}
    made = Bound(bound.flights, bound.windows, GIVEN, bound.simulator, bound.flexible, found, share, "")
    return replace(made, sentence=_sentence(made, verdict.corrected is not None))


def errors_of(predictor: Predictor, flights: list[tuple[str, Windows, Prediction]]) -> dict[str, dict[str, float]]:
    """See ``Errors``."""
    sums, count = {q: np.zeros(flights[0][1].horizon) for q in QUANTITIES}, 0
    for _, windows, came in flights:
        for q, errors in window_errors(predictor.predict(windows), came).items():
            sums[q] += errors.sum(axis=0)
        count += len(windows)
    return {q: {**{str(h): float(s[h - 1] / count) for h in HORIZONS}, "sum": float(s.sum() / count)}
            for q, s in sums.items()}


def _sentence(found: Bound, named: bool) -> str:
    parts = []
    for q, title, unit in (("position_mae_m", "position", "m"), ("rate_mae_rad_s", "rate", "rad/s")):
        before, best, after = (errors[q]["50"] for errors in (found.simulator, found.flexible, found.corrected))
        parts.append(f"{title} {before:.3f} {unit} by the simulator, {best:.3f} with the network"
                     + (f", {after:.3f} with what was named" if named else ""))
    return (f"A network without physics shows how much of the error functions of state and inputs can remove at least. "
            f"It was trained on the other flights ({found.flights} held out in turn, {found.windows} windows). After "
            f"half a second: {'; '.join(parts)}.")
