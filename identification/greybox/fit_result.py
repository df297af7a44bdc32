"""What a fit found, for a person and for a file."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from nanobench_tools.results.fitted_values import Estimate
from nanobench_tools.results.result import OPTIONAL, Result

from .flyability import Flight

COLOURS = {"from the flights": "#2563eb", "prior": "#888888", "no interval": "#d97706"}


@dataclass(frozen=True, repr=False)
class FitResult(Result):
    """``trouble``: why this fit is no result (empty: it is one); ``flown``: whether the model flies (None where its
    rate is held); ``not_identified``, ``priors``, ``nuisances``: sentences; ``assumed``: what flights do not show
    and was taken as given; ``thrust_spread``: standard deviation of the thrust of single flights, as a share of
    ``thrust_scale.s`` (None: not a physical vehicle)."""

    name: str
    adapt: str
    parameters: Mapping[str, Estimate]
    n_windows: int
    n_flights: int
    steps: int
    cost: float
    trouble: str
    flown: Flight | None
    not_identified: tuple[str, ...]
    priors: tuple[str, ...]
    nuisances: tuple[str, ...]
    assumed: tuple[str, ...] = ()
    thrust_spread: float | None = field(default=None, metadata=OPTIONAL)

    @property
    def remarks(self) -> dict[str, str]:
        """Remarks on parameters for the exported file."""
        if self.thrust_spread is None:
            return {}
        return {"thrust_scale.s": f"single flights differ by {100.0 * self.thrust_spread:.1f} % (standard deviation)"}

    @property
    def is_result(self) -> bool:
        return not self.trouble

    def summary(self) -> str:
        """Parameters with units and intervals, and all caveats."""
        wide = max(map(len, self.parameters), default=0)
        lines = [f"{self.name}: {self.n_windows} windows of {self.n_flights} flights"
                 + f", {self.steps} steps" * bool(self.steps)]
        for name, entry in self.parameters.items():
            ends = entry.ci95
            between = "" if ends is None else f"  [{ends[0]:.4g}, {ends[1]:.4g}]"
            share = "" if entry.prior_share is None else (
                "  prior" if entry.prior_share == 1.0 else f"  prior {100.0 * entry.prior_share:.0f} %")
            lines.append(f"  {name:<{wide}}  {entry.value:>11.5g}{between}  {entry.unit}{share}")
        if self.n_flights < 3:
            lines.append(f"  no intervals: {self.n_flights} flight(s) cannot show how flights differ")
        lines += [f"  prior: {text}" for text in self.priors]
        lines += [f"  assumed: {text}" for text in self.assumed]
        lines += [f"  random effect of every training flight: {text}" for text in self.nuisances]
        lines += [f"  not identified: {text}" for text in self.not_identified]
        if self.flown is not None:
            lines.append(f"  {self.flown}")
        if self.trouble:
            lines.append(f"  NO RESULT: {self.trouble}")
        return "\n".join(lines)

    def plot(self) -> Any:
        """A plotly figure: 95 % intervals of all parameters, relative to their values; priors in grey, parameters
        without an interval as a point."""
        import plotly.graph_objects as go

        figure = go.Figure()
        shown = set()
        for name, entry in self.parameters.items():
            size = abs(entry.value) or 1.0
            low, high = ((end - entry.value) / size for end in entry.ci95 or (entry.value, entry.value))
            kind = ("prior" if entry.prior_share == 1.0 else "from the flights") if entry.ci95 else "no interval"
            label = f"{name} = {entry.value:.4g} {entry.unit}"
            figure.add_trace(go.Scatter(x=[100 * low, 0.0, 100 * high], y=[label] * 3, mode="lines+markers", name=kind,
                                        legendgroup=kind, showlegend=kind not in shown, hovertext=entry.ci_why,
                                        line={"color": COLOURS[kind]}))
            shown.add(kind)
        figure.update_layout(title=f"{self.name}: 95 % intervals, {self.n_flights} flights",
                             xaxis_title="difference from the value, %", yaxis={"autorange": "reversed"})
        return figure
