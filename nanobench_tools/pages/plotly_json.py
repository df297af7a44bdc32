"""Plotly's JSON of a figure: traces, axes, shapes. ``chart.js`` adds what the window decides: places and colours.

A colour is ``var(--NAME)``, a variable of the style sheet.
"""

from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np

from .figure import Axis, Choice, Colour, Drawing, Mark, Panel
from .packed import Values, as_json

MODES = {"line": "lines", "area": "lines", "points": "markers", "both": "lines+markers"}
NUMBERS_PX, LETTER_PX = 62.0, 6.4
"""Room left of a panel for numbers, and for each letter of a name."""
LETTERS = {"y": 40, "x": 16}
LETTERS_ON_A_PHONE = 18
"""A longer name of a row loses its beginning."""
SHORTEST_DECADES, LONGEST_DECADES = 0.7, 3.0
"""Between these a logarithmic axis has ticks at 1, 2 and 5, above at powers of ten, below at even steps."""
EDGE = 0.03
"""Room at both ends of a path, as a share of its width."""


def spec(drawing: Drawing) -> dict[str, Any]:
    """Of a figure ``data`` and ``layout`` of Plotly, and what ``chart.js`` needs to place each panel. Of a choice its
    lists and the figure of every combination."""
    if isinstance(drawing, Choice):
        return {"labels": list(drawing.labels), "figures": {"\t".join(key): spec(one)
                                                            for key, one in drawing.figures.items()}}
    layout: dict[str, Any] = {"shapes": [], "annotations": []}
    data, panels, first_timed = [], [], ""
    for k, panel in enumerate(drawing.panels):
        n = str(k + 1) if k else ""
        x, y = (_axis(axis, way, [v for mark in panel.marks for v in _ends(mark, way)])
                for axis, way in ((panel.x, "x"), (panel.y, "y")))
        if panel.timed:
            x |= {"matches": first_timed} if first_timed else {}
            first_timed = first_timed or f"x{n}"
        if panel.equal:
            x["constrain"], y["constrain"], y["scaleanchor"] = "range", "domain", f"x{n}"
            x.setdefault("range", _with_margin(panel))
        layout |= {f"xaxis{n}": {**x, "anchor": f"y{n}"}, f"yaxis{n}": {**y, "anchor": f"x{n}"}}
        layout["shapes"] += _shapes(panel, f"x{n}", f"y{n}")
        if panel.title:
            layout["annotations"].append({
                "text": f"<b>{escape(panel.title, quote=False)}</b>", "x": 0, "y": 1,
                "xref": f"x{n} domain", "yref": f"y{n} domain", "xanchor": "left", "yanchor": "bottom",
                "showarrow": False, "font": {"size": 12}})
        axes = {"xaxis": f"x{n}", "yaxis": f"y{n}"}
        data += [{**trace, **axes} for mark in panel.marks for trace in _traces(mark, panel)]
        panels.append(_place(panel))
    for place in (timed := [place for place in panels if "timed" in place]):  # one time axis above the other
        place["left"] = max(other["left"] for other in timed)
    return {"title": drawing.title, "note": drawing.note, "cursor": drawing.cursor, "panels": panels, "data": data,
            "layout": layout}


def _with_margin(panel: Panel) -> list[float]:
    """First and last x with room for the width of a line, which would be cut at the frame."""
    values = np.concatenate([np.zeros(0), *(_finite(v) for mark in panel.marks for v in _ends(mark, "x"))])
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
    room = EDGE * max(high - low, 0.05)
    return [low - room, high + room]


def _place(panel: Panel) -> dict[str, Any]:
    """Height and room to the left [px], unit of the values, and names of the rows as a phone shows them. Also height
    over width of the data where both have one scale."""
    found: dict[str, Any] = {"height": panel.height, "left": NUMBERS_PX, "unit": panel.y.unit}
    found |= {key: True for key in ("title", "wide", "timed") if getattr(panel, key)}
    if panel.y.rows:
        longest = max(len(name) for name in panel.y.rows)
        found["left"] = 14.0 + LETTER_PX * min(longest, LETTERS["y"])
        found["short"] = _names(panel.y.rows, LETTERS_ON_A_PHONE)
    if panel.equal:
        width, height = (max(float(np.ptp(values)), 0.05) if len(values) else 1.0 for values in (
            np.concatenate([_finite(v) for mark in panel.marks for v in _ends(mark, way)]) for way in "xy"))
        found["aspect"] = round(height / width, 4)
    return found


def _axis(axis: Axis, way: str, values: Sequence[Values]) -> dict[str, Any]:
    found: dict[str, Any] = {"title": {"text": escape(axis.title) + (f" [{escape(axis.unit)}]" if axis.unit else "")},
                             "zeroline": axis.zero, "rangemode": "tozero" if axis.zero else "normal"}
    if axis.rows:
        ends = [-0.6, len(axis.rows) - 0.4]
        found |= {"tickvals": list(range(len(axis.rows))), "ticktext": _names(axis.rows, LETTERS[way]), "ticks": "",
                  "showgrid": False, "fixedrange": True, "zeroline": False, "range": ends[::-1 if way == "y" else 1]}
    elif axis.log:
        good = np.concatenate([_finite(v) for v in values]) if values else np.ones(1)
        good = good[good > 0.0]
        decades = float(np.log10(good.max() / good.min())) if len(good) else 0.0
        found |= {"type": "log", "tickformat": "~g", "nticks": 5}
        if decades > SHORTEST_DECADES:
            found["dtick"] = "D2" if decades < LONGEST_DECADES else 1
    if axis.range:
        found["range"] = [float(np.log10(v)) if axis.log else v for v in axis.range]
    return found


def _names(rows: Sequence[str], letters: int) -> list[str]:
    """Names of rows; the library reads &quot; of a name literally."""
    return [escape(name if len(name) <= letters else f"…{name[1 - letters:]}", quote=False) for name in rows]


def _shapes(panel: Panel, x: str, y: str) -> list[dict[str, Any]]:
    shaded = [{"type": "rect", "xref": x, "yref": f"{y} domain", "x0": start, "x1": end, "y0": 0, "y1": 1,
               "layer": "below", "fillcolor": _colour(colour), "opacity": 0.16, "line": {"width": 0}}
              for start, end, colour in panel.shaded]
    rules = [{"type": "line", "xref": x if way == "x" else f"{x} domain", "yref": y if way == "y" else f"{y} domain",
              **({"x0": at, "x1": at, "y0": 0, "y1": 1} if way == "x" else {"x0": 0, "x1": 1, "y0": at, "y1": at}),
              "line": {"color": _colour("ink"), "width": 1.2, "dash": "dot"}} for way, at in panel.rules]
    return [*shaded, *rules]


def _traces(mark: Mark, panel: Panel) -> list[dict[str, Any]]:
    """The trace of a mark, behind it its filled interval. ``meta`` is the name in the legend, ``customdata`` the time
    of each value."""
    colour, name = _colour(mark.colour), escape(mark.name)
    units = [f" {escape(axis.unit)}" if axis.unit else "" for axis in (panel.x, panel.y)]
    shared: dict[str, Any] = {"meta": mark.name, "name": name, "visible": not mark.hidden}
    text = {} if mark.text is None else {"text": [escape(said) for said in mark.text]}
    marker = {"color": colour, "opacity": 1.0 if mark.fade is None else as_json(mark.fade)}
    if mark.kind == "bars":
        assert mark.high is not None
        told = "%{text}" if text else f"%{{base:.4~g}} to %{{x:.4~g}}{units[0]}"
        return [{**shared, **text, "type": "bar", "orientation": "h", "base": as_json(mark.x), "y": as_json(mark.y),
                 "x": as_json(_less(mark.high, mark.x)), "width": mark.size, "textposition": "none", "marker": marker,
                 "hovertemplate": f"<b>{name}</b><br>{told}<extra></extra>"}]
    told = "%{text}" if text else f"%{{x:.4~g}}{units[0]}, %{{y:.4~g}}{units[1]}"
    main = {**shared, **text, "type": "scatter", "mode": MODES[mark.kind], "x": as_json(mark.x), "y": as_json(mark.y),
            "line": {"color": colour, "width": mark.width, "dash": mark.dash},
            "marker": {**marker, "symbol": mark.symbol,
                       "size": mark.size if isinstance(mark.size, (int, float)) else as_json(mark.size)},
            **({"hovertemplate": f"<b>{name}</b><br>{told}<extra></extra>"} if mark.name else {"hoverinfo": "skip"}),
            **({} if mark.t is None else {"customdata": as_json(mark.t)})}
    if mark.low is None or mark.high is None:
        return [main]
    if mark.kind == "area":
        return [{**shared, "type": "scatter", "mode": "lines", "line": {"width": 0}, "hoverinfo": "skip",
                 "fill": "toself", "fillcolor": colour, "opacity": 0.22, **_outline(mark.x, mark.low, mark.high)}, main]
    value = mark.x if mark.across else mark.y
    main["error_x" if mark.across else "error_y"] = {
        "type": "data", "symmetric": False, "color": colour, "thickness": 1.5, "width": 4,
        "array": as_json(_less(mark.high, value)), "arrayminus": as_json(_less(value, mark.low))}
    return [main]


def _outline(x: Values, low: Values, high: Values) -> dict[str, Any]:
    """Along the upper ends and back along the lower ones, where there are both."""
    at, below, above = (_floats(v) for v in (x, low, high))
    there = np.isfinite(below) & np.isfinite(above)
    return {"x": as_json(np.concatenate([at[there], at[there][::-1]])),
            "y": as_json(np.concatenate([above[there], below[there][::-1]]))}


def _less(more: Values, less: Values) -> np.ndarray:
    """The difference where it is positive, else 0; a value that is missing has none."""
    return np.asarray(np.nan_to_num(np.maximum(_floats(more) - _floats(less), 0.0)))


def _ends(mark: Mark, way: str) -> list[Values]:
    """Values of a mark along x or y with the ends of their intervals."""
    own = mark.x if way == "x" else mark.y
    across = mark.across or mark.kind == "bars"
    return [own, *(end for end in (mark.low, mark.high) if end is not None and across == (way == "x"))]


def _floats(values: Values) -> np.ndarray:
    return np.array([np.nan if value is None else value for value in values], float)


def _finite(values: Values) -> np.ndarray:
    found = _floats(values)
    return np.asarray(found[np.isfinite(found)])


def _colour(name: Colour) -> str:
    return f"var(--{name})"
