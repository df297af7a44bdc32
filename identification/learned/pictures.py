"""Pictures of learned rows: error against horizon, learning curves, predicted paths of a held-out flight, commands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from nanobench_tools.errors import MissingExtraError
from nanobench_tools.harness.results import write_bytes
from nanobench_tools.methods import Predictor
from nanobench_tools.metrics.prediction import QUANTITIES
from nanobench_tools.protocols.labels import family_of
from nanobench_tools.protocols.task1 import Case
from nanobench_tools.protocols.windows import cut_windows

TITLES = ("position m", "velocity m/s", "attitude rad", "rate rad/s")
APART = 5
"""Every fifth window is drawn, so that predicted paths follow one another."""


def plotly() -> tuple[Any, Any]:
    """(graph_objects, make_subplots); MissingExtraError without plotly."""
    try:
        import plotly.graph_objects as figures
        from plotly.subplots import make_subplots
    except ImportError as error:
        raise MissingExtraError("plotly", "report") from error
    return figures, make_subplots


def horizon_figure(rows: Sequence[Mapping[str, Any]]) -> Any:
    """Mean error against the horizon of every row of group ``all``, onboard truth."""
    go, make_subplots = plotly()
    figure = make_subplots(2, 2, subplot_titles=TITLES)
    mine = [r for r in rows if (r["group"], r["truth"]) == ("all", "onboard") and not r.get("trouble")]
    seconds = 0.01 * np.arange(1, 51)
    for i, row in enumerate(mine):
        for k, name in enumerate(QUANTITIES):
            figure.add_trace(go.Scatter(x=seconds, y=row["curve"][name], name=row["model"], legendgroup=row["model"],
                                        showlegend=not k, line={"color": colour(i),
                                                                "dash": "solid" if "fit" in row["model"] else "dot"}),
                             row=k // 2 + 1, col=k % 2 + 1)
    figure.update_xaxes(title_text="s after the start")
    figure.update_yaxes(rangemode="tozero")
    return figure.update_layout(title="Mean error against the horizon, held-out flights (fits solid, others dotted)",
                                height=800)


def learning_figure(learned: Mapping[str, Mapping[str, Any]]) -> Any:
    """Loss (solid) and validation loss (dotted) of every training by epoch; ``history`` as the JSON holds it."""
    go, _ = plotly()
    figure = go.Figure()
    for i, (name, about) in enumerate(learned.items()):
        history = np.array(about["history"], float)
        for number, one in enumerate(history if history.ndim == 3 else history[None]):
            for column, dash in ((0, "solid"), (1, "dot")):
                figure.add_trace(go.Scatter(x=np.arange(1, len(one) + 1), y=one[:, column], name=name, legendgroup=name,
                                            showlegend=not (column or number), line={"color": colour(i), "dash": dash}))
    figure.update_yaxes(type="log", title_text="loss, each in its own unit")
    figure.update_xaxes(title_text="epoch", type="log")
    return figure.update_layout(title="Learning curves: loss (solid), validation (dotted)", height=600)


def path_figure(cases: Sequence[Case], predictors: Sequence[Predictor], family: str = "helix") -> Any:
    """Half seconds predicted one after another along a held-out flight of ``family`` (else the first), from above."""
    go, _ = plotly()
    case = next((c for c in cases if family_of(c.flight) == family), cases[0])
    past = any(p.information == "past" for p in predictors)
    cut = cut_windows(case.flight, case.spans, "onboard", past)
    figure = go.Figure()
    if cut is None:
        return figure
    windows, came = cut
    drawn = slice(0, len(windows), APART)

    def line(path: np.ndarray, name: str, number: int, width: float) -> None:
        broken = np.concatenate([path[drawn], np.full((len(path[drawn]), 1, 3), np.nan)], axis=1).reshape(-1, 3)
        figure.add_trace(go.Scatter(x=broken[:, 0], y=broken[:, 1], name=name, mode="lines",
                                    line={"color": colour(number), "width": width}))

    line(came.position_m, "motion capture", len(predictors), 4.0)
    for i, predictor in enumerate(predictors):
        line(predictor.predict(windows).position_m, predictor.name, i, 1.5)
    figure.update_yaxes(scaleanchor="x", title_text="y m")
    figure.update_xaxes(title_text="x m")
    return figure.update_layout(title=f"Predicted half seconds along {case.flight.name}, which nobody trained on",
                                height=800)


def command_figure(logged: np.ndarray, commanded: Mapping[str, np.ndarray], name: str) -> Any:
    """Motor commands (m, 4) of cloned policies along a flight as it was flown, beside the logged ones."""
    go, make_subplots = plotly()
    figure = make_subplots(4, 1, shared_xaxes=True, subplot_titles=[f"motor {i + 1}" for i in range(4)])
    seconds = 0.01 * np.arange(len(logged))
    for i, (label, commands) in enumerate({"logged": logged, **commanded}.items()):
        for motor in range(4):
            figure.add_trace(go.Scatter(x=seconds, y=commands[:, motor], name=label, legendgroup=label,
                                        showlegend=not motor, line={"color": colour(i), "width": 1.0}),
                             row=motor + 1, col=1)
    figure.update_xaxes(title_text="s", row=4, col=1)
    return figure.update_layout(title=f"PWM ratios along {name}, which no policy was shown", height=900)


def colour(number: int) -> str:
    """Hues apart from each other."""
    return f"hsl({(47 * number + 210) % 360}, 70%, {40 + 12 * (number % 2)}%)"


def write_page(path: Path, figures: Sequence[Any], synthetic: bool) -> None:
    """One self-contained page."""
    word = "SYNTHETIC" if synthetic else "real"
    parts = [figure.to_html(full_html=False, include_plotlyjs=not i) for i, figure in enumerate(figures)]
    page = (f'<!doctype html><html lang="en"><meta charset="utf-8"><title>Learned models</title>'
            f"<h1>Learned models, {word} flights</h1>{''.join(parts)}</html>")
    write_bytes(path, page.encode())
