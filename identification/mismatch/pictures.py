"""Plot data of the page of a diagnosis: where the residual is, which effects explain it, and the rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from nanobench_tools import so3

from .binned import binned, block_numbers
from .left import Left, Predicted, Structure
from .moments import MEMORY, Covariate, force_covariates, torque_covariates
from .proof import HORIZONS, QUANTITIES
from .recordings import Recordings
from .track import ROW_S
from .verdict import Verdict
from .wrench import CHANNELS

MEAN_S = 0.25
"""Residuals over time are means of this long."""
BINS = 10
SHOWN = 4
"""Covariates that are drawn."""
CELLS = 9
"""Cells of the map along its longer side."""
FARTHEST = 4.0
"""Shares of the way from the simulator to the flights."""
LEAST_CELL_M = 0.1
NOT_DRAWN = ("constant", "flight", "hypothesis", *MEMORY)
"""Groups of covariates that are not informative in a plot: rates follow a torque as well as cause one."""
UNITS = {"velocity": "m/s", "speed x": "m²/s²", "world": "1", "lateral": "m²/s²", "1 / height": "1/m²",
         "height": "m", "position": "m", "battery": "V", "time": "s"}


def pictures(verdict: Verdict, recordings: Recordings) -> dict[str, Any]:
    """Everything the page's script needs, by picture; without a residual only the spans."""
    found: dict[str, Any] = {"spans": spans(recordings)}
    if verdict.left is None:
        return found
    left = verdict.left()
    forces, whole_rms = by_flight(left), rms(left)
    asked = [name for name, n in zip(CHANNELS, whole_rms["samples"], strict=True) if n]
    names = {t.flight: t.name for t in left.wrench.tracks}
    return {**found, "flights": [names[n] for n in sorted(names)], "channels": asked, "named": left.named,
            "whole": whole(verdict, left.structure) if left.structure else [], "rms": whole_rms,
            "timeline": timeline(left), "share": share(left.structure) if left.structure else {"groups": []},
            "first": int(np.argmax([b or 0.0 for b in forces["before"]])), "worst": _worst(whole_rms),
            "by_flight": forces, "covariates": covariates(left), "room": room(left), "scores": left.scores,
            "intervals": intervals(verdict.body), "errors": errors(left.predicted)}


def _worst(found: Mapping[str, Any]) -> int:
    """The channel with the largest ratio of the residual to that of a right simulator."""
    return int(np.argmax([(b or 0.0) / max(f or 0.0, 1e-9) if n else 0.0
                          for b, f, n in zip(found["before"], found["floor"], found["samples"], strict=True)]))


def rounded(values: np.ndarray, digits: int = 4) -> list[Any]:
    """Numbers rounded to ``digits`` significant digits; None for a value that is not finite."""
    return [rounded(v, digits) if np.ndim(v) else float(f"{v:.{digits}g}") if np.isfinite(v) else None for v in values]


def spans(recordings: Recordings) -> list[dict[str, Any]]:
    """For each flight: when it flew, which rows were judged, where its data are at fault."""
    entries = []
    for number, flight in enumerate(recordings.flights):
        audit = recordings.audits.get(flight.name)
        judged = [edge for t in recordings.tracks if t.flight == number for edge in _runs(t.time_s, t.counts)]
        faults = [(f.start_s, f.end_s, f"{f.kind} in {f.stream}" if f.stream else f.kind)
                  for name, f in recordings.faults if name == flight.name]
        airborne = [[s.start_s, s.end_s] for s in audit.airborne] if audit else []
        entries.append({"name": flight.name, "airborne": airborne, "judged": judged,
                        "faults": [[float(a), float(b), text] for a, b, text in faults
                                   if np.isfinite(a) and np.isfinite(b)]})
    return entries


def _runs(time_s: np.ndarray, counts: np.ndarray) -> list[list[float]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], counts, [False]]).astype(int)))
    return [[round(float(time_s[a]), 2), round(float(time_s[b - 1]), 2)]
            for a, b in zip(edges[::2], edges[1::2], strict=True)]


def whole(verdict: Verdict, structure: Structure) -> list[dict[str, Any]]:
    """Shares of the part that the covariates predict: explained by each finding, unexplained, and by chance."""
    before, after = float(structure.before.sum()), float(structure.after.sum())
    after, chance = min(after, before), structure.chance
    shares = [(entry["term"], entry["residual_share"]) for entry in verdict.body["findings"]]
    total = sum(s for _, s in shares) or 1.0
    rest = "not explained" if verdict.body["unknown"] else "too small to be named"
    parts = [*((name, (before - after) * s / total) for name, s in shares), (rest, after), ("chance", chance)]
    return [{"name": name, "share": size / (before + chance)} for name, size in parts]


def rms(left: Left) -> dict[str, Any]:
    """RMS of each channel before and after, and that of a right simulator."""
    sides = np.array([[np.sqrt(np.sum(side**2) / max(len(side), 1)) for side in left.of(c)] for c in range(6)])
    least = np.minimum(left.floor, sides.min(axis=1))
    return {"before": rounded(sides[:, 0]), "after": rounded(sides[:, -1]), "floor": rounded(least),
            "samples": [len(left.at(c)) for c in range(6)]}


def timeline(left: Left) -> list[list[dict[str, Any]]]:
    """[flight][channel]: means over MEAN_S, before and after, over the time of the recording; interrupted at gaps."""
    found = []
    for flight in np.unique(left.wrench.flight):
        lines: list[dict[str, Any]] = []
        for c in range(6):
            mine = left.wrench.flight[left.at(c)] == flight
            slot = np.floor(left.wrench.of("time_s", left.at(c)[mine]) / MEAN_S).astype(int)
            if not len(slot):
                lines.append({})
                continue
            first, number = int(slot.min()), int(np.ptp(slot)) + 1
            many = np.bincount(slot - first, minlength=number)
            lines.append({"start_s": first * MEAN_S, "step_s": MEAN_S,
                          "sides": [rounded(np.where(many > 0, np.bincount(slot - first, side[mine], number)
                                                     / np.maximum(many, 1), np.nan)) for side in left.of(c)]})
        found.append(lines)
    return found


def share(structure: Structure) -> dict[str, Any]:
    """Part that the covariates predict before, chance included [%], by group of covariates and channel, and its rest
    after."""
    before, after = structure.before, structure.after
    total = float(before.sum()) + structure.chance
    seen = np.maximum(before, after).max(axis=0) > 5e-4 * total
    return {"groups": [g for g, s in zip(structure.groups, seen, strict=True) if s],
            "before": rounded(100.0 * before.T[seen] / total), "after": rounded(100.0 * after.T[seen] / total)}


def by_flight(left: Left) -> dict[str, Any]:
    """RMS of the force residual of each flight."""
    flight = left.wrench.flight[left.wrench.force_at]
    sides = [np.sum(side[0] ** 2, axis=1) for side in (left.before, left.after)]
    each = np.array([[np.sqrt(np.mean(side[flight == f])) if (flight == f).any() else np.nan for side in sides]
                     for f in np.unique(left.wrench.flight)])
    return {"before": rounded(each[:, 0]), "after": rounded(each[:, 1])}


def covariates(left: Left) -> list[dict[str, Any]]:
    """The SHOWN pairs of channel and covariate that are correlated most: means in bins of equally many samples. Each
    channel and group appears once, if possible."""
    nothing = np.zeros((len(left.wrench.force_at), 3, 0))
    known: Sequence[list[Covariate]] = [*force_covariates(left.wrench, nothing, ()), *(
        [] if left.wrench.unasked else torque_covariates(left.wrench))]
    found = []
    for c in range(len(known)):
        at = left.at(c)
        blocks = block_numbers(left.wrench.track[at], left.wrench.of("time_s", at))
        for covariate in known[c]:
            if covariate.group in NOT_DRAWN or np.ptp(covariate.values) < 1e-9:
                continue
            edges = np.unique(np.quantile(covariate.values, np.linspace(0.0, 1.0, BINS + 1)[1:-1]))
            bins = np.searchsorted(edges, covariate.values, side="right")
            means = binned(np.stack([*left.of(c), covariate.values], axis=1), bins, blocks, len(edges) + 1)
            if means.shown.sum() < 3:
                continue
            off = means.mean[:, 0] - np.average(means.mean[:, 0], weights=means.samples)
            strength = float(np.mean((off[means.shown] / np.maximum(means.half[means.shown, 0], 1e-9)) ** 2))
            found.append((strength, c, covariate, means))
    chosen: list[tuple[float, int, Covariate, Any]] = []
    for least in (True, False):
        for entry in sorted(found, key=lambda e: -e[0]):
            fresh = all(entry[1] != e[1] and entry[2].group != e[2].group for e in chosen)
            if len(chosen) < SHOWN and entry[0] > 1.0 and (fresh if least else all(entry is not e for e in chosen)):
                chosen.append(entry)
    return [{"channel": CHANNELS[c], "unit": _unit(c), "covariate": covariate.name, "axis": _named_unit(covariate.name),
             "x": rounded(means.mean[means.shown, -1]),
             "sides": [{"mean": rounded(means.mean[means.shown, s]), "half": rounded(means.half[means.shown, s])}
                       for s in range(2 if left.named else 1)], "samples": int(means.samples.sum())}
            for _, c, covariate, means in sorted(chosen, key=lambda e: -e[0])]


def _unit(channel: int) -> str:
    return "m/s²" if channel < 3 else "rad/s²"


def _named_unit(name: str) -> str:
    return next((unit for start, unit in UNITS.items() if name.startswith(start)), "1")


def room(left: Left) -> dict[str, Any]:
    """The force residual in the world, in cells of the room seen from above; of every flight, then of all together."""
    wrench, at = left.wrench, left.wrench.force_at
    place = wrench.of("position_m", at)[:, :2]
    low, extent = place.min(axis=0), np.ptp(place, axis=0)
    size = max(float(extent.max()) / CELLS, LEAST_CELL_M)
    many = np.floor(extent / size).astype(int) + 1
    cell = np.minimum(np.floor((place - low) / size).astype(int), many - 1)
    bins, count = cell[:, 0] * many[1] + cell[:, 1], int(many.prod())
    sides = [left.before, left.after] if left.named else [left.before]
    world = np.concatenate([so3.rotate(wrench.quaternion[at], side[0]) for side in sides], axis=1)
    blocks = block_numbers(wrench.track[at], wrench.of("time_s", at))
    flight = wrench.flight[at]
    maps = []
    for mine in [*(flight == f for f in np.unique(wrench.flight)), np.ones(len(at), bool)]:
        values = np.concatenate([world[mine], place[mine]], axis=1)
        means = binned(values, bins[mine], blocks[mine], count)
        keep = means.samples >= int(0.2 / ROW_S / 4)
        told = means.shown[keep]
        maps.append({"x": rounded(means.mean[keep, -2]), "y": rounded(means.mean[keep, -1]),
                     "sides": [{"mean": rounded(means.mean[keep, 3 * s:3 * s + 3]),
                                "told": [(told & (np.linalg.norm(means.mean[keep, 3 * s:3 * s + 2], axis=1) >
                                                  np.linalg.norm(means.half[keep, 3 * s:3 * s + 2], axis=1))).tolist(),
                                         (told & (np.abs(means.mean[keep, 3 * s + 2]) >
                                                  means.half[keep, 3 * s + 2])).tolist()]}
                               for s in range(len(sides))]})
    return {"cell_m": size, "maps": maps}


def intervals(body: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Each parameter as a share of the way from the simulator's value (0) to the flights' (1). Ends of its interval
    beyond FARTHEST are drawn there."""
    found = []
    for entry in body["findings"]:
        for name, p in entry["parameters"].items():
            way = p["value"] - p["believed"]
            if way != 0.0:
                ends = np.clip(sorted((edge - p["believed"]) / way for edge in p["ci95"]), -FARTHEST, FARTHEST)
                found.append({"name": name, "ends": rounded(ends), "believed": p["believed"],
                              "value": p["value"], "unit": p["unit"]})
    return found


def errors(proof: Predicted) -> dict[str, Any]:
    """Errors of prediction per flight: [horizon][quantity] lists."""
    return {"flights": list(proof.flights), "steps": list(HORIZONS), "quantities": list(QUANTITIES),
            "held_out": proof.held_out, "before": rounded(np.moveaxis(proof.before, 0, 2)),
            "after": rounded(np.moveaxis(proof.after, 0, 2))}
