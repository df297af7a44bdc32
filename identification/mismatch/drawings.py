"""Figures of a diagnosis: the data of ``pictures``, on axes with units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from nanobench_tools.pages.figure import Axis, Choice, Colour, Drawing, Figure, Mark, Panel, before_and_after
from nanobench_tools.pages.packed import rounded

GIVEN, CORRECTED = "simulator as given", "corrected"
SHADES: tuple[Colour, ...] = ("orange", "blue")
PARTS: tuple[Colour, ...] = ("blue", "green", "purple", "orange", "sky")
FATES: dict[str, tuple[str, Colour]] = {
    "named": ("identified", "blue"), "equivalent": ("indistinguishable from it", "sky"),
    "withdrawn": ("identified, then rejected", "red"),
    "leaning": ("not sure enough", "green"),
    "rejected": ("rejected", "orange"), "explained": ("explained by the identified effects", "purple"),
    "small": ("too little", "grey")}
ALL_FLIGHTS = "all flights together"
QUANTITIES = (("position", "m"), ("velocity", "m/s"), ("attitude", "rad"), ("rate", "rad/s"))
ARROW = 1.5
"""The longest arrow of a map, in cells."""


def drawings(drawn: Mapping[str, Any], steps: Sequence[tuple[int, str]], n: str, recorded: str) -> dict[str, Drawing]:
    """Figures by name; drawn: as ``pictures`` gives it, n, recorded: how much the residual and the data are of."""
    found: dict[str, Drawing | None] = {"spans": spans(drawn["spans"], recorded)}
    if "flights" in drawn:
        sides = [GIVEN, CORRECTED] if drawn["named"] else [GIVEN]
        found |= {"whole": whole(drawn["whole"], n), "rms": rms(drawn, n), "timeline": timeline(drawn, sides),
                  "share": share(drawn, n), "covariates": covariates(drawn["covariates"], sides),
                  "room": room(drawn, sides), "by_flight": by_flight(drawn, n), "scores": scores(drawn["scores"], n),
                  "intervals": intervals(drawn["intervals"], n), "errors": errors(drawn, steps, n)}
    return {name: figure for name, figure in found.items() if figure is not None}


def rows_of(names: Sequence[str]) -> list[float]:
    return [float(i) for i in range(len(names))]


def spans(found: Sequence[Mapping[str, Any]], recorded: str) -> Figure | None:
    if not found:
        return None
    marks = []
    for name, key, colour, size in (("in the air", "airborne", "grey", 0.25), ("judged", "judged", "green", 0.55)):
        bars = [(a, b, float(i)) for i, s in enumerate(found) for a, b in s[key]]
        if bars:
            starts, ends, at = (list(v) for v in zip(*bars, strict=True))
            marks.append(Mark(name, starts, at, "bars", colour, size=size, high=ends))
    faults = [((a + b) / 2.0, i - 0.28, f"{text}: {a:.1f} to {b:.1f} s") for i, s in enumerate(found)
              for a, b, text in s["faults"]]
    if faults:
        middle, above, said = (list(v) for v in zip(*faults, strict=True))
        marks.append(Mark("fault (its middle)", middle, above, "points", "orange", symbol="triangle-down", text=said))
    return Figure(f"When it flew, and what was judged; {recorded}",
                  "Orange marks: a fault in some stream; short gaps of the radio are usual.",
                  [Panel(Axis("time of the recording", "s"), Axis(rows=[s["name"] for s in found]), marks,
                         height=80 + 26 * len(found), wide=True)])


def whole(parts: Sequence[Mapping[str, Any]], n: str) -> Figure | None:
    if not parts:
        return None
    ends = 100.0 * np.cumsum([part["share"] for part in parts])
    starts = np.concatenate([[0.0], ends[:-1]])
    colours = [*(PARTS[i % len(PARTS)] for i in range(len(parts) - 2)), "grey", "sky"]
    marks = [Mark(f"{part['name']} {100.0 * part['share']:.0f} %", [a], [0.0], "bars", colour, size=0.8,
                  high=[b], fade=[0.35 if part is parts[-1] else 1.0])
             for part, a, b, colour in zip(parts, starts.tolist(), ends.tolist(), colours, strict=True)]
    return Figure(f"What takes the residual away; {n}",
                  "The bar is the part of the residual that speed, attitude, height, place, time and other signals "
                  "predict. Each colour is what one effect explains. Grey remains. The palest part is what chance "
                  "predicts of a right simulator.",
                  [Panel(Axis("of what signals predict of the residual", "%", range=(0.0, 100.0)), Axis(rows=[" "]),
                         marks, height=110, wide=True)])


def rms(drawn: Mapping[str, Any], n: str) -> Figure:
    sides: list[tuple[str, str, Colour]] = [("before", GIVEN, "orange"), ("floor", "a right simulator", "green")]
    if drawn["named"]:
        sides.insert(1, ("after", CORRECTED, "blue"))
    panels = []
    for first, unit in ((0, "m/s²"), (3, "rad/s²")):
        names = drawn["channels"][first:first + 3]
        if names:
            shift = np.linspace(-0.26, 0.26, len(sides))
            marks = [Mark(name, [0.0] * len(names), (np.arange(len(names)) + off).tolist(), "bars", colour,
                          size=0.5 / len(sides), high=drawn["rms"][key][first:first + len(names)])
                     for (key, name, colour), off in zip(sides, shift, strict=True)]
            panels.append(Panel(Axis("RMS", unit, zero=True), Axis(rows=names), marks,
                                "Force" if first == 0 else "Torque; gyro noise is most of it", 230))
    return Figure(f"Residual by channel; {n}", "The shorter the better; green is what disturbances and noise leave "
                  "however right the simulator is.", panels)


def timeline(drawn: Mapping[str, Any], sides: Sequence[str]) -> Drawing | None:
    figures: dict[tuple[str, ...], Figure] = {}
    order = [drawn["first"], *(i for i in range(len(drawn["flights"])) if i != drawn["first"])]
    channels = [drawn["worst"], *(c for c in range(len(drawn["channels"])) if c != drawn["worst"])]
    for flight in order:
        for channel in channels:
            part = drawn["timeline"][flight][channel] if channel < len(drawn["timeline"][flight]) else {}
            if not part or channel >= len(drawn["channels"]):
                continue
            values = [np.array([np.nan if v is None else v for v in side], float) for side in part["sides"]]
            time_s = part["start_s"] + part["step_s"] * (0.5 + np.arange(len(values[0])))
            name = drawn["channels"][channel]
            figures[drawn["flights"][flight], name] = Figure(
                "Residual over time", "Means of a quarter of a second. A right simulator wavers around zero; a hole is "
                "where nothing was judged.",
                [Panel(Axis("time of the recording", "s"), Axis(name, unit_of(channel), zero=True),
                       [Mark(side, time_s, rounded(v, 1e-3), colour=colour)
                        for side, v, colour in zip(sides, values, SHADES, strict=False)], height=340, wide=True)])
    return Choice(("Flight", "Channel"), figures) if figures else None


def unit_of(channel: int) -> str:
    return "m/s²" if channel < 3 else "rad/s²"


def share(drawn: Mapping[str, Any], n: str) -> Figure | None:
    """Cells as squares: the larger, the more."""
    groups = ["shape of a term" if g == "hypothesis" else g for g in drawn["share"]["groups"]]
    channels = drawn["channels"]
    if not groups:
        return None
    panels = []
    for key, title in (("before", GIVEN), *((("after", CORRECTED),) if drawn["named"] else ())):
        cells = np.array(drawn["share"][key], float).reshape(len(groups), -1)[:, :len(channels)]
        top = max(float(np.max(drawn["share"]["before"])), 20.0)
        at = [(j, i) for i in range(len(groups)) for j in range(len(channels))]
        marks = [Mark("per cent", [float(j) for j, _ in at], [float(i) for _, i in at], "points", symbol="square",
                      size=[26.0 * float(np.sqrt(max(cells[i, j], 0.0) / top)) for j, i in at],
                      text=[f"{channels[j]}, {groups[i]}: {cells[i, j]:.2f} %" for j, i in at])]
        panels.append(Panel(Axis(rows=channels), Axis(rows=groups), marks, title, 80 + 32 * len(groups)))
    return Figure(f"Which signals the residual goes with; {n}",
                  "Per cent of what signals predict of the residual, chance included. The larger a square, the more of "
                  "the residual is in this channel and goes with this kind of signal. After the correction the squares "
                  "should be gone.", panels)


def covariates(found: Sequence[Mapping[str, Any]], sides: Sequence[str]) -> Figure | None:
    panels = [Panel(Axis(k["covariate"], k["axis"]), Axis(k["channel"], k["unit"], zero=True), [
        Mark(name, k["x"], side["mean"], "both", colour, symbol=symbol,
             low=[m - h for m, h in zip(side["mean"], side["half"], strict=True)],
             high=[m + h for m, h in zip(side["mean"], side["half"], strict=True)])
        for name, side, colour, symbol in zip(sides, k["sides"], SHADES, ("circle", "square"), strict=False)],
        f"{k['channel']} over {k['covariate']}; n = {k['samples']} samples", 300) for k in found]
    return Figure("The signals it goes with most", "Means of tenths of the samples with 95 % bars; a right simulator "
                  "lies on zero.", panels) if panels else None


def room(drawn: Mapping[str, Any], sides: Sequence[str]) -> Drawing | None:
    """The force in the world, in cells of the room: sideways as arrows, up and down as triangles."""
    maps, cell = drawn["room"]["maps"], drawn["room"]["cell_m"]
    means = np.concatenate([np.array(m["sides"][0]["mean"], float).reshape(-1, 3) for m in maps])
    longest = max(float(np.hypot(means[:, 0], means[:, 1]).max(initial=0.0)), 1e-9)
    tallest = max(float(np.abs(means[:, 2]).max(initial=0.0)), 1e-9)
    names = [*drawn["flights"], ALL_FLIGHTS]
    figures: dict[tuple[str, ...], Figure] = {}
    for k in [len(names) - 1, *range(len(names) - 1)]:
        if not maps[k]["x"]:
            continue
        for side, name in enumerate(sides):
            part = maps[k]["sides"][side]
            figures[names[k], name] = _room(
                np.array([maps[k]["x"], maps[k]["y"]], float).T, np.array(part["mean"], float),
                np.array(part["told"], bool), cell, longest, tallest, SHADES[side])
    return Choice(("Flight", "Simulator"), figures) if figures else None


def _room(at: np.ndarray, mean: np.ndarray, told: np.ndarray, cell: float, longest: float, tallest: float,
          colour: Colour) -> Figure:
    said = [f"x {m[0]:.3f}, y {m[1]:.3f}, z {m[2]:.3f} m/s²" for m in mean]
    tip = at + ARROW * cell / longest * mean[:, :2]
    ways, heights = [], []
    for name, keep, shade, width in (("significant", told[0], colour, 2.5), ("not significant", ~told[0], "grey", 1.2)):
        line = np.stack([at, tip, np.full_like(at, np.nan)], axis=1)[keep].reshape(-1, 2)
        ways += [Mark(name, line[:, 0], line[:, 1], colour=shade, width=width),
                 Mark(name, at[keep, 0], at[keep, 1], "points", shade, size=5,
                      text=[s for s, k in zip(said, keep, strict=True) if k])]
    size = 5.0 + 17.0 * np.sqrt(np.abs(mean[:, 2]) / tallest)
    for name, keep, shade, symbol in (("up", told[1] & (mean[:, 2] > 0), "blue", "triangle-up"),
                                      ("down", told[1] & (mean[:, 2] <= 0), "red", "triangle-down"),
                                      ("not significant", ~told[1], "grey", "circle-open")):
        heights.append(Mark(name, at[keep, 0], at[keep, 1], "points", shade, symbol=symbol,
                            size=size[keep].tolist(), text=[s for s, k in zip(said, keep, strict=True) if k]))
    return Figure("The room from above: the force that is left",
                  f"Mean force of each cell, in the world. Left: a line from the dot of {ARROW * cell:.2f} m of the "
                  f"map is {longest:.2g} m/s². Lines that all point one way are a wind or a tilted frame, lines "
                  "around one spot a force of that place. Right: area stands for size; the largest is "
                  f"{tallest:.2g} m/s² with the simulator as given. One cell in twenty is coloured by chance.",
                  [Panel(Axis("x", "m"), Axis("y", "m"), ways, "sideways", 420, equal=True),
                   Panel(Axis("x", "m"), Axis("y", "m"), heights, "up and down", 420, equal=True)])


def by_flight(drawn: Mapping[str, Any], n: str) -> Figure:
    after = (CORRECTED, drawn["by_flight"]["after"]) if drawn["named"] else None
    panel = before_and_after("RMS of the force residual", "m/s²", drawn["flights"],
                             (GIVEN, drawn["by_flight"]["before"]), after)
    return Figure(f"Force residual of every flight; {n}", "A flight far to the right of others that were flown alike "
                  "differs from them: something was changed between flights. Faster flights show more of anything.",
                  [panel])


def scores(found: Mapping[str, Any], n: str) -> Figure | None:
    rows = [r for r in found["rows"] if r["gain"] > 1.0]
    if not rows:
        return None
    marks = []
    for key, (name, colour) in FATES.items():
        mine = [(float(i), r["gain"]) for i, r in enumerate(rows) if r["fate"] == key]
        if mine:
            at, gain = (list(v) for v in zip(*mine, strict=True))
            marks.append(Mark(name, gain, at, "points", colour, size=11))
    what, unit = found["axis"]
    return Figure(f"{found['title']}; {n}", found["note"],
                  [Panel(Axis(what, unit, log=True), Axis(rows=[r["term"] for r in rows]), marks,
                         height=80 + 24 * len(rows), wide=True, rules=[("x", found["least"])])])


def intervals(found: Sequence[Mapping[str, Any]], n: str) -> Figure | None:
    if not found:
        return None
    at = rows_of([p["name"] for p in found])
    marks = [Mark("simulator", [0.0] * len(found), at, "points", "orange", symbol="x", size=10,
                  text=[f"{p['believed']:.4g} {p['unit']}" for p in found]),
             Mark("flights, 95 %", [1.0] * len(found), at, "points", "blue", low=[p["ends"][0] for p in found],
                  high=[p["ends"][1] for p in found], across=True,
                  text=[f"{p['value']:.4g} {p['unit']}" for p in found])]
    return Figure(f"Parameters on the way from the simulator to the flights; {n}",
                  "Left, at 0, the simulator's value; at 1 what the flights say, with its 95 % interval. An interval "
                  "that reaches 0 could be no change at all.",
                  [Panel(Axis("share of the way", "1", zero=True), Axis(rows=[p["name"] for p in found]), marks,
                         height=90 + 28 * len(found), wide=True)])


def errors(drawn: Mapping[str, Any], steps: Sequence[tuple[int, str]], n: str) -> Drawing:
    found = drawn["errors"]
    note = "Mean over windows of each flight; the further left, the better."
    note += " Each flight is predicted by a fit without it." if drawn["named"] and found["held_out"] else ""
    figures: dict[tuple[str, ...], Figure] = {}
    for step in reversed(range(len(steps))):
        for quantity, (name, unit) in enumerate(QUANTITIES):
            after = (CORRECTED, found["after"][step][quantity]) if drawn["named"] else None
            figures[f"{steps[step][1]} (h = {steps[step][0]})", name] = Figure(
                f"Error of prediction, every flight; {n}", note,
                [before_and_after(f"error of {name}", unit, found["flights"],
                                  (GIVEN, found["before"][step][quantity]), after)])
    return Choice(("After", "Error of"), figures)
