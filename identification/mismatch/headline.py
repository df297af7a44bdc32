"""The first lines of a verdict: missing effects, the gain from correcting them, and suitable uses of the simulator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

from nanobench_tools.physics.term_words import in_words

Good = Literal["yes", "no", "cannot say"]
HOVER_M = 0.125
"""Error of position after half a second that an acceleration wrong by 1 m/s^2 makes: an integrator takes that out."""
MPC_M = 0.0625
"""The same of 0.5 m/s^2: a prediction that is off by more is corrected late at every step."""
LEARNING = 1.5
"""Errors over those of the best model of the same flights: a learned policy exploits any error."""
RULES = {
    "hover": f"position error after 0.5 s below {100 * HOVER_M:.1f} cm (an acceleration error of 1 m/s^2)",
    "mpc": f"position error after 0.5 s below {100 * MPC_M:.2g} cm (an acceleration error of 0.5 m/s^2)",
    "learning": f"every error after 0.1 and 0.5 s at most {LEARNING:g} times that of the best model of these flights"}
LISTED = 3
"""Terms of a class that a headline lists."""
WORSE = 1.1
"""Times the error before the correction, from which on a headline reports another quantity that became worse."""
QUANTITIES = {"velocity_m_s": "velocity", "attitude_rad": "attitude", "rate_rad_s": "rate"}
USES = {"hover": "hover and position control", "mpc": "model-predictive control", "learning": "simulation for learning"}


def good_for(improvement: Mapping[str, Any] | None, which: str = "before") -> dict[str, Good]:
    """{use: yes | no | cannot say} of the given (``before``) or corrected (``after``) simulator.

    ``RULES`` decide.

    improvement: as in verdict.json; errors of flights left out of the fit.
    """
    found = (improvement or {}).get("50") or {}
    position = (found.get(which) or {}).get("position_m")
    if position is None:
        return dict.fromkeys(USES, "cannot say")
    return {"hover": "yes" if position < HOVER_M else "no", "mpc": "yes" if position < MPC_M else "no",
            "learning": _as_good(improvement or {}, which)}


def _as_good(improvement: Mapping[str, Any], which: str) -> Good:
    ratios = []
    for h in ("10", "50"):
        row = improvement.get(h) or {}
        floor = row.get("floor")
        if not floor:
            return "cannot say"
        ratios += [row[which][q] / best for q, best in floor.items() if best and row[which].get(q) is not None]
    return "cannot say" if not ratios else "yes" if max(ratios) <= LEARNING else "no"


def headline(body: Mapping[str, Any]) -> str:
    """One sentence: what the simulator omits, if anything, how large the error is, and what remains after the
    correction."""
    improvement = body.get("improvement") or {}
    half = improvement.get("50") or {}
    before, after = ((half.get(k) or {}).get("position_m") for k in ("before", "after"))
    flights = len(improvement.get("held_out") or [])
    where = f" on {flights} flight{'s' * (flights != 1)} left out" if flights else ""
    findings = body.get("findings") or []
    names = ", ".join(f"{one_of(f)}{_axes(f, findings)} ({f['confidence']:.0%})" for f in findings)
    unknown = body.get("unknown") or {}
    between = [one_of({"term": first, "equivalent": others}) for first, *others in unknown.get("between") or []]
    beside = f" and about {' and about '.join(between)}" if between else (
        " and something no term describes" if unknown else "")
    error = "" if before is None else f"; position error after 0.5 s {before:.3f} m{where}"
    if names:
        mended = "" if before is None or after is None else (
            f"; position error after 0.5 s {before:.3f} -> {after:.3f} m{where}{_became_worse(half)}")
        return f"The simulator is wrong about {names}{beside}{mended}."
    if ratio := body.get("thrust_ratio"):
        return (f"The simulator is of another vehicle: its thrust over mass is {ratio:.2g} times that of these "
                "flights.")
    leaning = body.get("leaning") or {}
    if body["outcome"] == "none" and leaning:
        most = max(leaning, key=lambda t: leaning[t])
        return (f"No effect is sure enough to be identified; the most probable is {in_words(most)} "
                f"({leaning[most]:.0%}){error}.")
    if between:
        return (f"The simulator is wrong, and these flights do not show what is missing: {'; '.join(between)}{error}.")
    if hides := unknown.get("hides"):
        return (f"The simulator leaves out something: perhaps {' or '.join(map(in_words, hides))}, perhaps what no "
                f"term describes{error}.")
    return {"none": f"The simulator agrees with these flights as well as logging allows{error}.",
            "unknown": f"The simulator leaves out something that no term describes{error}.",
            "data_fault": "The data are at fault; no conclusion about physics.",
            }.get(body["outcome"], "No conclusion about physics.")


def _became_worse(half: Mapping[str, Any]) -> str:
    """Words for the quantities that the correction predicts worse, half a second ahead."""
    before, after = (half.get(k) or {} for k in ("before", "after"))
    worse = [word for q, word in QUANTITIES.items()
             if before.get(q) and after.get(q) and after[q] > WORSE * before[q]]
    return f", but {' and '.join(worse)} became worse" if worse else ""


def one_of(finding: Mapping[str, Any]) -> str:
    """The term, and those that these flights cannot distinguish from it."""
    members = [in_words(term) for term in (finding["term"], *(finding.get("equivalent") or []))]
    rest = len(members) - LISTED
    return " or ".join([*members[:LISTED], *([f"{rest} other{'s' * (rest > 1)}"] if rest > 0 else [])])


def _axes(finding: Mapping[str, Any], findings: Sequence[Mapping[str, Any]]) -> str:
    """Of a finding that shares a term with another one: its axes."""
    mine = {finding["term"], *(finding.get("equivalent") or [])}
    shared = any(mine & {f["term"], *(f.get("equivalent") or [])} for f in findings if f is not finding)
    return f" in {' and '.join(finding['where']['axes'])}" if shared else ""


def uses(good: Mapping[str, Good]) -> str:
    """Suitable uses, in a line."""
    return "Good enough for: " + "; ".join(f"{USES[use]}: {answer}" for use, answer in good.items()) + "."
