"""A recording as a plotly figure (extra ``report``): position, turning, motors and battery over time."""

from collections.abc import Mapping, Sequence
from typing import Any

from ..errors import MissingExtraError
from .dataframes import Sampled

MOST_POINTS = 2000
PANELS: tuple[tuple[str, str, tuple[tuple[str, tuple[str, ...], str], ...]], ...] = (
    ("position, m", "position", (("mocap", ("px", "py", "pz"), "motion capture"), ("estimator", ("x", "y", "z"),
                                                                                   "onboard estimate"))),
    ("rate, rad/s", "gyro", (("imu", ("gyro_x", "gyro_y", "gyro_z"), "gyro"),)),
    ("motor command", "motor commands", (("motor", tuple(f"m{i}" for i in range(1, 9)), "motor"),
                                         ("command", ("thrust",), "collective"))),
    ("battery, V", "battery voltage", (("battery", ("vbat",), "battery"),)))
"""(axis, what it is in words, its streams as (stream, quantities, name in the legend)) of each panel."""


def plotly() -> tuple[Any, Any]:
    """(plotly.graph_objects, make_subplots); MissingExtraError without plotly."""
    try:
        import plotly.graph_objects as go
        from plotly.subplots import make_subplots
    except ImportError:
        raise MissingExtraError("plotly", "report") from None
    return go, make_subplots


def missing(figure: Any, text: str, row: int | None = None) -> None:
    """Writes ``text`` across a panel (or the whole figure) that has nothing to draw."""
    axis = "" if row in (None, 1) else str(row)
    figure.add_annotation(text=text, xref=f"x{axis} domain" if row else "paper", x=0.5, y=0.5, showarrow=False,
                          yref=f"y{axis} domain" if row else "paper")


def thinned(n: int) -> slice:
    """Every k-th of n rows, at most about MOST_POINTS."""
    return slice(None, None, max(1, n // MOST_POINTS))


def flight_figure(name: str, streams: Mapping[str, Sampled]) -> Any:
    """Four panels over seconds from the first row. A panel whose streams are missing says so."""
    go, make_subplots = plotly()
    figure = make_subplots(rows=len(PANELS), cols=1, shared_xaxes=True, vertical_spacing=0.04)
    for row, (axis, what, sources) in enumerate(PANELS, 1):
        lines = [(stream, quantity, label) for stream, quantities, label in sources if stream in streams
                 for quantity in quantities if quantity in streams[stream].quantities]
        for stream, quantity, label in lines:
            found = streams[stream]
            keep = thinned(len(found.time_s))
            figure.add_trace(go.Scatter(x=found.time_s[keep], mode="lines", name=f"{label} {quantity}", legendgroup=row,
                                        y=found.values[keep, found.quantities.index(quantity)]), row=row, col=1)
        if not lines:
            missing(figure, f"no {what}: this recording has no {' or '.join(s for s, _, _ in sources)} stream", row)
        figure.update_yaxes(title_text=axis, row=row, col=1)
    figure.update_xaxes(title_text="time, s", row=len(PANELS), col=1)
    figure.update_layout(title=name, height=800)
    return figure


def named_in(names: Sequence[str], limit: int = 6) -> str:
    """The first names of many, and how many more there are.

    >>> named_in(["a", "b", "c"], 2)
    'a, b and 1 more'
    """
    return ", ".join(names[:limit]) + (f" and {len(names) - limit} more" if len(names) > limit else "")
