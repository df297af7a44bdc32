"""Pictures of learned rows: error against horizon, learning curves, predicted paths of a held-out flight, commands."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from nanobench_tools.methods import Predictor
from nanobench_tools.metrics.prediction import QUANTITIES
from nanobench_tools.protocols.task1 import Case, PredictionRow
from nanobench_tools.protocols.windows import cut_windows
from nanobench_tools.results.flight_figure import plotly
from nanobench_tools.results.result_files import write_bytes
from nanobench_tools.sources.labels import family_of

TITLES = ("position m", "velocity m/s", "attitude rad", "rate rad/s")
SHOWN = ("naive", "published_physics", "fit_balanced", "fit_observed")
"""Of the untrained rows, those drawn for comparison."""
STYLE = """
body { font: 1rem/1.5 system-ui, sans-serif; max-width: 62rem; margin: 0 auto; padding: 0 .8rem; color: #1c2024 }
h1 { font-size: 1.5rem } .banner { color: #b04a00; font-weight: 600 }"""
_MARKS = [m * 10.0**k for k in range(-6, 5) for m in (1, 2, 5)]
LOG = {"type": "log", "tickvals": _MARKS, "ticktext": [f"{mark:g}" for mark in _MARKS]}
"""A logarithmic axis whose marks are all numbers of one size."""
APART = 5
"""Every fifth window is drawn, so that predicted paths follow one another."""


def horizon_figure(rows: Sequence[PredictionRow]) -> Any:
    """Mean error against the horizon of every row of group ``all``, onboard truth."""
    go, make_subplots = plotly()
    figure = make_subplots(4, 1, subplot_titles=TITLES, vertical_spacing=0.06)
    mine = [r for r in rows if (r.group, r.truth, r.start) == ("all", "onboard", "centred") and not r.trouble
            and (r.model in SHOWN or not r.model.startswith(("fit_", "published_")))]
    seconds = 0.01 * np.arange(1, 51)
    for i, row in enumerate(mine):
        for k, name in enumerate(QUANTITIES):
            figure.add_trace(go.Scatter(x=seconds, y=(row.curve or {})[name], name=row.model, legendgroup=row.model,
                                        showlegend=not k, line={"color": colour(i),
                                                                "dash": "solid" if "fit" in row.model else "dot"}),
                             row=k + 1, col=1)
    figure.update_xaxes(title_text="s after the start", row=4, col=1)
    figure.update_yaxes(**LOG)
    return _laid_out(figure, "Mean error against the horizon,<br>held-out flights<br>(fits solid, others dotted)", 1500)


def learning_figure(learned: Mapping[str, Sequence[Any]]) -> Any:
    """Loss (solid) and validation loss (dotted) of every training by epoch; histories (epochs, 2), or several, by
    name."""
    go, _ = plotly()
    figure = go.Figure()
    for i, (name, losses) in enumerate(learned.items()):
        history = np.array(losses, float)
        for number, one in enumerate(history if history.ndim == 3 else history[None]):
            for column, dash in ((0, "solid"), (1, "dot")):
                figure.add_trace(go.Scatter(x=np.arange(1, len(one) + 1), y=one[:, column], name=name, legendgroup=name,
                                            showlegend=not (column or number), line={"color": colour(i), "dash": dash}))
    figure.update_yaxes(**LOG, title_text="loss, each in its own unit")
    figure.update_xaxes(**LOG, title_text="epoch")
    return _laid_out(figure, "Learning curves:<br>loss (solid), validation (dotted)", 640)


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
    figure.update_yaxes(scaleanchor="x", title_text="y m", constrain="domain", constraintoward="top")
    figure.update_xaxes(title_text="x m", constrain="domain")
    title = f"Predicted half seconds along a {family_of(case.flight)}<br>that nobody trained on:<br>{case.flight.name}"
    return _laid_out(figure, title, 680)


def command_figure(logged: np.ndarray, commanded: Mapping[str, np.ndarray], name: str) -> Any:
    """Motor commands (m, 4) of cloned policies along a flight as it was flown, and the logged ones."""
    go, make_subplots = plotly()
    figure = make_subplots(4, 1, shared_xaxes=True, vertical_spacing=0.05,
                           subplot_titles=[f"motor {i + 1}" for i in range(4)])
    seconds = 0.01 * np.arange(len(logged))
    for i, (label, commands) in enumerate({"logged": logged, **commanded}.items()):
        for motor in range(4):
            figure.add_trace(go.Scatter(x=seconds, y=commands[:, motor], name=label, legendgroup=label,
                                        showlegend=not motor, line={"color": colour(i), "width": 1.0}),
                             row=motor + 1, col=1)
    figure.update_xaxes(title_text="s", row=4, col=1)
    return _laid_out(figure, f"Motor commands (PWM ratios),<br>cloned and logged, held-out flight<br>{name}", 1000)


def _laid_out(figure: Any, title: str, height: int) -> Any:
    """Legible on a phone too: the legend is below."""
    figure.update_annotations(font_size=14)
    return figure.update_layout(title={"text": title, "font": {"size": 16}, "x": 0.0, "xref": "paper"}, height=height,
                                template="plotly_white", margin={"l": 56, "r": 12, "t": 135, "b": 40},
                                legend={"orientation": "h", "yanchor": "top", "y": -60.0 / height, "x": 0.0})


def colour(number: int) -> str:
    """Hues apart from each other."""
    return f"hsl({(137 * number + 210) % 360}, 70%, {40 + 12 * (number % 2)}%)"


def write_page(path: Path, figures: Sequence[Any], synthetic: bool, title: str = "Learned models") -> None:
    """One self-contained page."""
    word = "SYNTHETIC" if synthetic else "real"
    parts = [figure.to_html(full_html=False, include_plotlyjs=not i, config={"responsive": True, "displaylogo": False})
             for i, figure in enumerate(figures)]
    banner = '<p class="banner">SYNTHETIC: from simulated practice flights, not from recordings of a vehicle.</p>'
    page = (f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
            f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{STYLE}</style></head><body>'
            f"<h1>{title}, {word} flights</h1>{banner if synthetic else ''}{''.join(parts)}</body></html>")
    write_bytes(path, page.encode())
