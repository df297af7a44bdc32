"""``nanobench prove --shipped``: public simulators that shipped wrong, diagnosed before and after their correction."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..errors import InputError
from ..steps.options import Options
from ..tables.result_table import Table as Grid
from .closing import again, close
from .prove_corrupted import recording_roots

if TYPE_CHECKING:
    from identification.prove.shipped.shipped_run import ShippedProof, ShippedResult
    from identification.prove.summary import Share

HEADS = ("simulator", "was wrong", "diagnosis", "shipped", "identified", "makers", "right?")


def shipped(options: Options, place: str, names: Sequence[str], engine: str) -> ShippedProof:
    """The cases of these names (default: all) on the recordings below ``place``. InputError without recordings."""
    from identification.prove.corrupted.engines import engine_of
    from identification.prove.shipped import ShippedJudge, prove_shipped, shipped_cases

    cases = shipped_cases(names)
    judge = ShippedJudge(engine_of(engine), recording_roots(place, "--shipped"), options.seed, options.say)
    proof = prove_shipped(judge, cases)
    asked = [c for c in proof.cases if c.vehicle]
    if asked and all(c.score is None for c in asked):
        raise InputError(f"--shipped {place}", "has no recordings of a vehicle of the cases",
                         "give the folder that has nanobench, crazyflie_usd and crazyswarm_lee")
    show(options, proof)
    return proof


def show(options: Options, proof: ShippedProof) -> None:
    """One table on one screen; with ``--verbose`` what each diagnosis reports."""
    table = Grid.plain(f"Simulators that shipped wrong, on real flights, engine {proof.engine}", HEADS,
                       [row(c) for c in proof.cases])
    counts = [f"{share_text(proof.identified)} known errors that predictions show are identified; "
              f"{share_text(proof.sized)} sizes are in their 95 % interval; "
              f"{share_text(proof.false)} cases have a false effect; {proof.not_applicable} not applicable, "
              f"{proof.absent} without recordings [exact 95 %]"]
    details = [f"{c.number} {c.name}: {c.score.before.paragraph} After the correction: {c.score.after.paragraph}"
               if c.score else f"{c.number} {c.name}: {c.reason}" for c in proof.cases]
    reasons = [f"{c.number} {c.name}: {c.score.why}" for c in proof.cases if c.score and c.score.why]
    close(options, f"{proof.right.right} of {proof.right.n} answers are right", "what each diagnosis reports",
          *again("--verbose"), screen=[table, *counts], detail=[table, *counts, *reasons, *details])


def row(case: ShippedResult) -> tuple[str, ...]:
    """Of a table with HEADS."""
    score, worst = case.score, case.worst
    if score is None:
        return (f"{case.number} {case.simulator}", case.what, "not applicable" if not case.vehicle else case.reason,
                "", "", "", "-")
    numbers = [] if worst is None else [number(x, worst.unit) for x in (worst.shipped, worst.identified,
                                                                        worst.corrected)]
    return (f"{case.number} {case.simulator}", case.what, answer(case), *(numbers or ("-", "-", "-")),
            "right" if score.right else "wrong")


def answer(case: ShippedResult) -> str:
    """What the diagnosis reports about the known error, in a cell."""
    score = case.score
    assert score is not None
    if score.answer == "another_vehicle" and score.identified:
        return "another vehicle"
    if score.before.outcome == "motor_geometry":
        return "motor order or spins impossible"
    if score.before.outcome == "refused":
        return "value refused"
    if not score.before.findings:
        return "another vehicle" if "of another vehicle" in score.before.paragraph else score.before.outcome
    sizes = [f"{k.by} {k.value:.3g} [{k.ci95[0]:.3g}, {k.ci95[1]:.3g}], true {k.true:.3g}" if k.value is not None and
             k.ci95 is not None and k.true is not None else k.by for k in score.known if k.by is not None]
    return "; ".join([*sizes, *(f"also {t}" for t in score.named if t not in [k.by for k in score.known])])


def number(x: float | None, unit: str) -> str:
    """``12.3 mm``; ``-`` for nothing."""
    if x is None:
        return "-"
    return f"{1e3 * x:.3g} m{unit}" if unit in ("m", "rad") else f"{x:.3g} {unit}"


def share_text(found: Share) -> str:
    """``12 of 15 [52, 96]``."""
    if found.ci95 is None:
        return "0 of 0"
    return f"{found.right} of {found.n} [{100 * found.ci95[0]:.0f}, {100 * found.ci95[1]:.0f}]"
