"""What a picture is: panels of marks on axes with units. ``plotly_json`` writes it as Plotly's JSON."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from .packed import Values

Colour = str
"""A name of the theme: ink, soft, grey, mocap, blue, orange, green, red, purple, sky."""
COLOURS: tuple[Colour, ...] = ("blue", "red", "green", "purple", "orange", "sky", "ink", "grey")
"""Of the first, second, ... line where a colour means nothing but which; distinguished by colour-blind eyes."""
SYMBOLS = ("circle", "square", "diamond", "triangle-up", "x", "star", "cross", "triangle-down")
DASHES = ("solid", "dash", "dot", "dashdot")
Entry = float | str | None


@dataclass(frozen=True)
class Mark:
    """One series of a panel. ``name`` is in the legend, once for all marks of that name.

    - x, y: values (n,), None or nan where missing.
    - kind: ``line``, ``points``, ``both``, ``area`` or ``bars``. An area is a line filled between ``low`` and ``high``.
      Bars lie, from ``x`` to ``high``.
    - low, high: ends of an interval (n,), of ``x`` where ``across``, else of ``y``.
    - text: label of each value (n,).
    - size: of each point or of all, px.
    - fade: opacity of each point (n,).
    - t: time of each value (n,), s: the cursor's dot is there at that time.
    """

    name: str
    x: Values
    y: Values
    kind: Literal["line", "points", "both", "area", "bars"] = "line"
    colour: Colour = "blue"
    dash: str = "solid"
    symbol: str = "circle"
    width: float = 2.0
    size: float | Sequence[float] = 8.0
    low: Values | None = None
    high: Values | None = None
    across: bool = False
    text: Sequence[str] | None = None
    fade: Sequence[float] | None = None
    t: Values | None = None
    hidden: bool = False


@dataclass(frozen=True)
class Axis:
    """One axis.

    - log: logarithmic, with readable ticks.
    - rows: names instead of numbers, the first on top (as y axis) or left.
    - range: first and last value, None: all data.
    - zero: the axis includes 0 and draws it."""

    title: str = ""
    unit: str = ""
    log: bool = False
    rows: Sequence[str] = ()
    range: tuple[float, float] | None = None
    zero: bool = False


@dataclass(frozen=True)
class Panel:
    """One plot.

    - shaded: spans of x with a colour; rules: dotted lines (``x`` or ``y``, value).
    - equal: both axes have one scale.
    - wide: it has a separate row.
    - timed: x is the time of the cursor; such panels zoom together."""

    x: Axis
    y: Axis
    marks: Sequence[Mark]
    title: str = ""
    height: int = 260
    shaded: Sequence[tuple[float, float, Colour]] = ()
    rules: Sequence[tuple[str, float]] = ()
    equal: bool = False
    wide: bool = False
    timed: bool = False


@dataclass(frozen=True)
class Figure:
    """A picture with its caption and how to read it.

    cursor: first and last time [s] of a slider that shows where everything is at one time. Two panels are side by side
    where there is room."""

    title: str
    note: str
    panels: Sequence[Panel]
    cursor: tuple[float, float] | None = None


@dataclass(frozen=True)
class Choice:
    """Several pictures in one place, chosen by lists: ``labels`` say what each list chooses, ``figures`` is by the
    chosen entries."""

    labels: tuple[str, ...]
    figures: Mapping[tuple[str, ...], Figure]

    @property
    def first(self) -> Figure:
        return next(iter(self.figures.values()))


Drawing = Figure | Choice


def styled(names: Sequence[str], symbols: bool = True) -> dict[str, dict[str, Any]]:
    """Colour, dash and symbol of every name, in their order."""
    return {name: {"colour": COLOURS[i % len(COLOURS)], "dash": DASHES[i // len(COLOURS) % len(DASHES)],
                   **({"symbol": SYMBOLS[i % len(SYMBOLS)]} if symbols else {})} for i, name in enumerate(names)}


def intervals(title: str, unit: str, names: Sequence[str], series: Mapping[str, tuple[Values, Values, Values]],
              log: bool = False, zero: bool = False) -> Panel:
    """One row a name and a point with its interval for every series: (value, low, high), each (n,)."""
    style = styled(list(series))
    at = np.arange(len(names), dtype=float)
    shift = np.linspace(-0.14, 0.14, len(series)) if len(series) > 1 else [0.0]
    marks = [Mark(name, value, at + off, "points", low=low, high=high, across=True, **style[name])
             for (name, (value, low, high)), off in zip(series.items(), shift, strict=True)]
    return Panel(Axis(title, unit, log=log, zero=zero), Axis(rows=names), marks, wide=True,
                 height=70 + 26 * len(names))


def before_and_after(title: str, unit: str, names: Sequence[str], before: tuple[str, Sequence[float | None]],
                     after: tuple[str, Sequence[float | None]] | None) -> Panel:
    """One row a name: the value before, the value after, and the way between."""
    at = np.arange(len(names), dtype=float)
    marks = [Mark(before[0], before[1], at, "points", "orange", size=9)]
    if after is not None:
        way = [v for a, b in zip(before[1], after[1], strict=True) for v in (a, b, None)]
        marks = [Mark("", way, np.repeat(at, 3), colour="grey"), *marks,
                 Mark(after[0], after[1], at, "points", "blue", symbol="square", size=9)]
    return Panel(Axis(title, unit, zero=True), Axis(rows=names), marks, wide=True, height=80 + 24 * len(names))
