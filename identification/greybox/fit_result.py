"""What a fit found, for a person and for a file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from nanobench_tools.results.fitted_values import Estimate
from nanobench_tools.results.result import Result

from .flyability import Flight


@dataclass(frozen=True, repr=False)
class FitResult(Result):
    """trouble: why this fit is no result (empty: it is one); flown: whether the model flies (None where its rate is
    held); not_identified, priors, nuisances: sentences."""

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

    @property
    def is_result(self) -> bool:
        return not self.trouble

    def summary(self) -> str:
        """Parameters with units and intervals, and all that has to be said beside them."""
        wide = max(map(len, self.parameters), default=0)
        lines = [f"{self.name}: {self.n_windows} windows of {self.n_flights} flights, {self.steps} steps"]
        for name, entry in self.parameters.items():
            ends = entry.ci95
            between = "" if ends is None else f"  [{ends[0]:.4g}, {ends[1]:.4g}]"
            lines.append(f"  {name:<{wide}}  {entry.value:>11.5g}{between}  {entry.unit}")
        if self.n_flights < 3:
            lines.append(f"  no intervals: {self.n_flights} flight(s) tell nothing about how flights differ")
        lines += [f"  prior: {text}" for text in self.priors]
        lines += [f"  random effect of every training flight: {text}" for text in self.nuisances]
        lines += [f"  not identified: {text}" for text in self.not_identified]
        if self.flown is not None:
            lines.append(f"  {self.flown}")
        if self.trouble:
            lines.append(f"  NO RESULT: {self.trouble}")
        return "\n".join(lines)

    def plot(self) -> Any:
        """A plotly figure: every parameter in units of the half-width of its interval around its value."""
        import plotly.graph_objects as go

        figure = go.Figure()
        for name, entry in self.parameters.items():
            if entry.ci95 is None:
                continue
            size = abs(entry.value) or 1.0
            low, high = ((end - entry.value) / size for end in entry.ci95)
            figure.add_trace(go.Scatter(x=[100 * low, 0.0, 100 * high], y=[name] * 3, mode="lines+markers",
                                        showlegend=False, name=name))
        figure.update_layout(title=f"{self.name}: 95 % intervals over {self.n_flights} flights",
                             xaxis_title="difference from the value, %", yaxis={"autorange": "reversed"})
        return figure
