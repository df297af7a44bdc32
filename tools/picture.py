"""Draw the picture of README.md: one recording with its verdict, as ``nb.audit(flight).plot()`` shows it.

``python -m tools.picture RECORDING [OUT.svg]`` needs a Chromium (as the page's tests do) and the extra ``report``.
"""

import re
import sys
from pathlib import Path
from shutil import which
from textwrap import wrap
from urllib.parse import unquote

from playwright.sync_api import sync_playwright
from plotly.offline import get_plotlyjs

import nanobench_tools as nb

OUT = Path(__file__).resolve().parents[1] / "docs/pictures/flight.svg"
WIDTH, HEIGHT = 900, 380


def as_svg(figure_json: str) -> str:
    """Render a Plotly figure as SVG text."""
    with sync_playwright() as tools:
        browser = tools.chromium.launch(executable_path=_chromium(), args=["--no-sandbox"])
        page = browser.new_page()
        page.set_content(f"<script>{get_plotlyjs()}</script><div id='p'></div>")
        url = str(page.evaluate(
            """async ([text, width, height]) => {
                 const figure = JSON.parse(text);
                 const size = {width, height: figure.layout.height ?? height};
                 await Plotly.newPlot('p', figure.data, {...figure.layout, ...size});
                 return await Plotly.toImage('p', {format: 'svg', ...size});
               }""", [figure_json, WIDTH, HEIGHT]))
        browser.close()
    def shorter(attribute: re.Match[str]) -> str:
        return re.sub(r"(\d+\.\d{2})\d+", r"\1", attribute[0])

    return re.sub(r'"[^"]*"', shorter, unquote(url.split(",", 1)[1]))  # numbers of the texts stay whole


def _chromium() -> str | None:
    return next((p for p in map(which, ("chromium", "chromium-browser", "google-chrome")) if p), None)


def main(recording: str, out: Path = OUT) -> None:
    flight = nb.load_flight(recording)
    figure = nb.audit(flight).plot()
    title = "<br>".join(wrap(figure.layout.title.text, 110))
    figure.update_layout(template="plotly_white", font={"family": "sans-serif", "size": 13}, paper_bgcolor="white",
                         title={"text": title, "font": {"size": 14}}, margin={"l": 110, "r": 20, "t": 70, "b": 45},
                         legend={"x": 0.01, "y": 0.32, "yanchor": "bottom", "bgcolor": "rgba(255,255,255,0.7)"})
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(as_svg(figure.to_json()))
    print(f"{out}: {out.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main(sys.argv[1], *(Path(a) for a in sys.argv[2:]))
