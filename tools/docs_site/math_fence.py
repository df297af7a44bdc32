"""Equations in ``math`` fences as inline SVG, which needs neither a script nor a font for mathematics."""

import html
import io
from typing import Any

from matplotlib.figure import Figure

SIZE = 13
"""Points."""


def math(source: str, language: str, css_class: str, options: Any, md: Any, **_: Any) -> str:
    """Return a fence of LaTeX as SVG, one equation a line, in the colour of the text."""
    return "\n".join(f'<div class="equation">{drawn(line)}</div>' for line in source.splitlines() if line.strip())


def drawn(equation: str) -> str:
    """Return an equation as an SVG element."""
    figure = Figure(figsize=(0.01, 0.01))
    figure.text(0, 0, f"${equation}$", fontsize=SIZE)
    file = io.StringIO()
    figure.savefig(file, format="svg", transparent=True, bbox_inches="tight", pad_inches=0.05,
                   metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    svg = file.getvalue()
    return svg[svg.index("<svg"):].replace("<svg", f'<svg role="img" aria-label="{html.escape(equation)}"', 1)
