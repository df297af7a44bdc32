"""Figures of the Python functions, by plotly (extra ``report``), which is imported when something is drawn."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..auditing.audit_verdict import AuditVerdict
from ..flight import Flight
from ..results.flight_figure import missing, plotly, thinned

if TYPE_CHECKING:
    import pandas as pd

    from identification.thrust.error_rows import Points
    from identification.thrust.thrust_result import Curve

SHADES = {"gap": "#888", "clock_wander": "#3b82f6", "clock_offset": "#3b82f6", "clock_drift": "#3b82f6"}
FAULT, USABLE = "#d97706", "#16a34a"
HEIGHTS = (("mocap", "pz", "height, motion capture"), ("estimator", "z", "height, estimate"))


def audit_figure(flight: Flight, verdict: AuditVerdict) -> Any:
    """Height and speed over time, faults shaded, usable spans as a bar."""
    go, make_subplots = plotly()
    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, row_heights=[0.75, 0.25], vertical_spacing=0.06)
    heights = [(stream, quantity, label) for stream, quantity, label in HEIGHTS
               if stream in flight and quantity in flight[stream]]
    for stream, quantity, label in heights:
        source = flight[stream]
        rows = thinned(len(source))
        figure.add_trace(go.Scatter(x=source.time_s[rows], y=source[quantity][rows], name=label, mode="lines"), row=1,
                         col=1)
    if not heights:
        missing(figure, "no height: this recording has no mocap or estimator stream", 1)
    events = [e for e in verdict.events if not e.information]
    for k, event in enumerate(events):
        for span in event.spans:
            figure.add_vrect(x0=span.start_s, x1=span.end_s, fillcolor=SHADES.get(event.kind, FAULT), opacity=0.08,
                             line_width=0, row=1, col=1)
        x = [t for s in event.spans for t in (s.start_s, s.end_s, None)]
        figure.add_trace(go.Scatter(x=x, y=[k + 1 if t is not None else None for t in x], mode="lines", name=event.kind,
                                    line={"width": 9, "color": SHADES.get(event.kind, FAULT)},
                                    hovertext=event.sentence, showlegend=False), row=2, col=1)
    x = [t for s in verdict.usable for t in (s.start_s, s.end_s, None)]
    figure.add_trace(go.Scatter(x=x, y=[0 if t is not None else None for t in x], mode="lines", name="usable",
                                line={"width": 9, "color": USABLE}, showlegend=False), row=2, col=1)
    figure.update_yaxes(title_text="height, m", row=1, col=1)
    figure.update_yaxes(tickvals=list(range(len(events) + 1)), ticktext=["usable", *(e.kind for e in events)], row=2,
                        col=1)
    figure.update_xaxes(title_text="time, s", row=2, col=1)
    figure.update_layout(title=f"{flight.name}: {verdict.sentence}")
    return figure


def paths_figure(trajectories: Mapping[str, pd.DataFrame], flight: str) -> Any:
    """x over y of every method, in m, to one scale."""
    go, _ = plotly()
    figure = go.Figure()
    for method, frame in trajectories.items():
        rows = frame.iloc[thinned(len(frame))]
        figure.add_trace(go.Scatter(x=np.ravel(rows["x"]), y=np.ravel(rows["y"]), name=method, mode="lines",
                                    line={"color": "#888"} if method == "truth" else None))
    figure.update_yaxes(scaleanchor="x", title_text="y, m")
    figure.update_layout(title=f"{flight} from above", xaxis_title="x, m")
    return figure


def end_errors_figure(metrics: pd.DataFrame) -> Any:
    """Error in m over the time since the last pose in s, a line per method (``Estimates.metrics`` of blackouts)."""
    go, _ = plotly()
    figure = go.Figure()
    horizons = [name for name in metrics if re.fullmatch(r"end_error_\d+s_m", name)]
    for method, row in metrics.iterrows():
        figure.add_trace(go.Scatter(x=[int(name.split("_")[2][:-1]) for name in horizons], name=method,
                                    y=[row[name] for name in horizons], mode="lines+markers"))
    if not horizons:
        missing(figure, "no trajectory and no blackout was scored")
    figure.update_layout(title="Error after the last pose, mean over flights", xaxis_title="s after the last pose",
                         yaxis_title="m")
    return figure


def prediction_figure(title: str, table: pd.DataFrame) -> Any:
    """Errors of position and attitude at the last step over the time of the flight, one below the other."""
    go, make_subplots = plotly()
    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.06)
    for row, (name, label) in enumerate((("position_mae_m", "position, m"), ("attitude_mae_rad", "attitude, rad")), 1):
        last = max(h for quantity, h in table.columns if quantity == name)
        figure.add_trace(go.Scatter(x=table.index, y=table[name, last], mode="lines", name=label), row=row, col=1)
        figure.update_yaxes(title_text=label, row=row, col=1)
    figure.update_xaxes(title_text="start of the half second, s", row=2, col=1)
    figure.update_layout(title=title, showlegend=False)
    return figure


def thrust_figure(name: str, curves: Sequence[Curve], points: Sequence[Points]) -> Any:
    """Thrust of one motor over the PWM ratio at several battery voltages, and the rows of stand series."""
    go, _ = plotly()
    figure = go.Figure()
    for curve in curves:
        figure.add_trace(go.Scatter(x=curve.pwm, y=curve.thrust_N, mode="lines", name=f"{curve.voltage_V:g} V"))
    for series in points:
        figure.add_trace(go.Scatter(x=series.pwm, y=series.measured, mode="markers", marker={"size": 3},
                                    name=f"{series.file} ({series.split})"))
    if not curves:
        missing(figure, "no map is a result")
    figure.update_layout(title=f"Thrust of one motor: {name}", xaxis_title="PWM ratio", yaxis_title="thrust, N")
    return figure


def tracking_figure(table: pd.DataFrame) -> Any:
    """RMSE in m of ``Tracking.table``, a bar a row, with its interval."""
    go, _ = plotly()
    figure = go.Figure()
    if table.empty:
        missing(figure, "no flight was scored")
    else:
        labels = [f"{row.controller} {row.reference} {row.speed or ''}" for row in table.itertuples()]
        up, down = table["rmse_m_high"] - table["rmse_m"], table["rmse_m"] - table["rmse_m_low"]
        figure.add_trace(go.Bar(x=labels, y=table["rmse_m"], error_y={
            "type": "data", "symmetric": False, "array": up, "arrayminus": down}))
    figure.update_layout(title="Tracking error of logged flights", yaxis_title="RMSE, m")
    return figure


def improvement_figure(table: pd.DataFrame) -> Any:
    """Bars of the error before and after, by horizon and quantity, on a logarithmic axis."""
    go, _ = plotly()
    figure = go.Figure()
    labels = [f"{quantity}, {10 * steps} ms" for steps, quantity in table.index]
    for column in ("before", "after"):
        figure.add_trace(go.Bar(x=labels, y=table[column], name=column))
    if not labels:
        missing(figure, "no prediction: this verdict has none, its paragraph says why")
    figure.update_layout(title="Prediction of flights left out", barmode="group",
                         yaxis={"type": "log", "dtick": 1, "exponentformat": "power"})
    return figure
