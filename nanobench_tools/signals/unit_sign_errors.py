"""Wrong units of a flight, each once, and the streams they concern."""

from .axis_unit_matching import AxisUnitMatch
from .context import Context
from .path_sizes import wrong_paths
from .plausible_ranges import WrongUnit, wrong_ranges
from .wrong_matches import wrong_matches

ACC = ("acc_x", "acc_y", "acc_z")


def wrong_units(context: Context) -> list[WrongUnit]:
    """Ranges first; faults that they explain are not reported again by the path and the comparison. Gravity alone
    decides the unit of the accelerometer: derivatives of noisy poses are larger than any acceleration."""
    found = list(context.once(wrong_ranges))
    reported = {(w.stream, q) for w in found for q in w.quantities}
    found += [w for w in context.once(wrong_paths) if not reported & {(w.stream, q) for q in w.quantities}]
    reported = {(w.stream, q) for w in found for q in w.quantities}
    for verdict in context.once(wrong_matches):
        if verdict.quantities == ACC:
            continue
        for axes, named in verdict.scaled:
            names = tuple(verdict.quantities[k] for k in axes)
            if any((verdict.stream, q) in reported for q in names):
                continue
            found.append(WrongUnit(verdict.stream, names, named.factor,
                                   f"{', '.join(names)} of {verdict.stream} {'are' if len(names) > 1 else 'is'} "
                                   f"{named.words} times what the {against(verdict)} predicts{named.reading}"))
    return found


def distorted_streams(context: Context) -> set[str]:
    """Streams whose values are in wrong units: sizes mean nothing there."""
    return {w.stream for w in context.once(wrong_units)}


def against(verdict: AxisUnitMatch) -> str:
    return (
        "vehicle's own streams"
        if verdict.stream == "mocap" and verdict.quantities[0] in ("px", "qx")
        else "motion capture"
    )
