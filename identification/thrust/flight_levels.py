"""Cost of the per-flight offset: rows next to the plain ones, each with its inputs.

The per-flight offset (mean error) is mostly the vehicle, the battery and the air of that day. A map of PWM and voltage
does not contain these. ``first seconds``: the level is learnt from the accelerometer over the first seconds in the
air, and what comes later is predicted. ``true level``: the mean error itself is taken off; no prediction, but what
would be left if levels were known.
"""

from collections.abc import Sequence

import numpy as np

from nanobench_tools.settings import number
from nanobench_tools.units import GRAVITY_M_S2

from .error_tables import Scored, can_predict, score
from .flight_rows import Flown
from .prediction_intervals import half_width
from .thrust_study import Study

FIRST_S = number("thrust.flight_levels.first_s")

CORRELATION_S = number("thrust.flight_levels.correlation_s")

GIVEN_FIRST = f"the plain row's and the accelerometer of the flight's first {FIRST_S:.0f} s in the air"
GIVEN_TRUE = "the mean error of the flight itself: a bound, no prediction"


def level_rows(found: Study, name: str, files: Sequence[Flown], split: str) -> list[Scored]:
    """Three results of the model ``name``.

    They are: later rows without learning, later rows with the offset of the first seconds, all rows with the true
    offset.
    """
    files = [f for f in files if can_predict(found.candidates[name], f)]
    plain = score(found, name, files, split)
    held = [(e, t) for e, t in zip(found.scores[name].errors, _times(found), strict=False) if len(e) == len(t)]
    share = trust(held)
    learnt = [later(e, t, share) for e, t in held]
    count = len(found.train)
    width = half_width([e for e in learnt if len(e)], count, groups=found.sessions)
    centred = half_width([e - e.mean() for e, _ in held], count, groups=found.sessions)
    rows = [Scored(f"{name}, after {FIRST_S:.0f} s", split, plain.uses, plain.status, plain.given),
            Scored(f"{name}, level of the first {FIRST_S:.0f} s", split, plain.uses, plain.status, GIVEN_FIRST),
            Scored(f"{name}, true level", split, plain.uses, "bound", GIVEN_TRUE)]
    for file, e, own in zip(files, plain.errors, plain.widths, strict=True):
        if len(after := later(e, file.time_s, 0.0)):
            rows[0].add(file, after, own)
            rows[1].add(file, later(e, file.time_s, share), width)
        rows[2].add(file, e - e.mean(), centred)
    return [row for row in rows if row.files]


def weight_row(files: Sequence[Flown], split: str) -> Scored:
    """What to say without any map: that the specific force is that of hovering."""
    row = Scored("weight", split, "g, nothing fitted", "ok", "nothing")
    for file in files:
        row.add(file, GRAVITY_M_S2 - file.force, float("nan"))
    return row


def later(missed: np.ndarray, time_s: np.ndarray, share: float) -> np.ndarray:
    """Errors after the first seconds, less ``share`` of the mean error of these."""
    first = time_s - time_s[0] < FIRST_S
    return np.asarray(missed[~first] - share * missed[first].mean())


def trust(held: Sequence[tuple[np.ndarray, np.ndarray]]) -> float:
    """Share of the first seconds' mean error that is the offset of the rest, 0 to 1. It is the slope through zero on
    training flights that were held out."""
    pairs = np.array([(e[first].mean(), e[~first].mean()) for e, t in held
                      for first in [t - t[0] < FIRST_S] if (~first).any()]).reshape(-1, 2)
    square = float(np.sum(pairs[:, 0] ** 2))
    return float(np.clip(np.sum(pairs[:, 0] * pairs[:, 1]) / square, 0.0, 1.0)) if square > 0.0 else 0.0


def _times(found: Study) -> list[np.ndarray]:
    """Timestamps of the training flights in the order of their held-out errors."""
    return [f.time_s for _, rest in found.folds for f in rest if isinstance(f, Flown)]
