"""Run the tutorials and the gallery and write their pages: ``python -m tools.tutorials [NAME ...]``.

``docs/tutorials/NAME.py`` or ``docs/gallery/NAME.py`` is a script in cells (``# %%``). Its page gets the text, the
code, what each cell prints, and a light and a dark picture of each figure that a cell ends with. ``# alt:`` is the
alternative text of the picture. Pictures need a Chromium.
"""

import ast
import contextlib
import io
import os
import re
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from textwrap import wrap
from typing import Any, NamedTuple

DOCS = Path(__file__).resolve().parents[1] / "docs"
SCRIPTS = {path.stem: path for folder in ("tutorials", "gallery") for path in sorted((DOCS / folder).glob("*.py"))}
"""Name -> script."""
LARGEST_PICTURE = 100_000
"""Bytes."""
TITLE_WIDTH = 110
"""Characters of a line of a title."""
PRINTED_WIDTH = 84
"""Characters of a printed line that a page of 1280 pixels shows."""
ALT = re.compile(r"^# alt: (.*)\n", re.M)


class Cell(NamedTuple):
    """A cell of a script: text or code, without its mark."""

    is_text: bool
    body: str


class Done(NamedTuple):
    """What a cell of code printed, and the figure it ended with."""

    printed: str
    figure: Any


def cells(script: str) -> Iterator[Cell]:
    """Yield the cells of a script in order."""
    for part in re.split(r"^# %%", script, flags=re.M)[1:]:
        mark, _, body = part.partition("\n")
        if "[markdown]" in mark:
            yield Cell(True, re.sub(r"^# ?", "", body, flags=re.M).strip())
        else:
            yield Cell(False, body.strip("\n"))


def run(name: str) -> list[tuple[Cell, Done | None]]:
    """Run a tutorial in an empty folder; its cells with what they gave."""
    variables: dict[str, Any] = {"__name__": "__main__"}
    done: list[tuple[Cell, Done | None]] = []
    here = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            for cell in cells(SCRIPTS[name].read_text(encoding="utf-8")):
                done.append((cell, None if cell.is_text else _run(cell.body, variables, name)))
        finally:
            os.chdir(here)
    return done


def _run(code: str, variables: dict[str, Any], name: str) -> Done:
    tree = ast.parse(code)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    out = io.StringIO()
    figure = None
    with contextlib.redirect_stdout(out):
        exec(compile(tree, f"{name}.py", "exec"), variables)
        if isinstance(last, ast.Expr):
            figure = eval(compile(ast.Expression(last.value), f"{name}.py", "eval"), variables)
    return Done("\n".join(line.rstrip() for line in out.getvalue().splitlines()), figure)


def folded(printed: str) -> str:
    """Printed text with its long sentences folded; lines of tables stay whole."""
    return "\n".join(line if re.search(r"\S  +\S", line) else
                     "\n".join(wrap(line, PRINTED_WIDTH, subsequent_indent="    ")) for line in printed.splitlines())


def page(name: str, done: list[tuple[Cell, Done | None]]) -> str:
    """Return the page of a tutorial that was run."""
    parts, pictures = [], 0
    for cell, given in done:
        if given is None:
            parts.append(cell.body)
            continue
        alt = ALT.search(cell.body)
        parts.append(f"```python\n{ALT.sub('', cell.body)}\n```")
        if given.printed:
            parts.append(f"```text\n{folded(given.printed)}\n```")
        if given.figure is not None:
            pictures += 1
            if alt is None:
                raise ValueError(f"{name}.py: the cell of picture {pictures} has no line '# alt: ...'")
            parts += [f"![{alt[1]}](pictures/{name}_{pictures}-{shade}.svg#only-{shade})"
                      for shade in ("light", "dark")]
    parts.append(f"*SYNTHETIC data. `python -m tools.tutorials {name}` writes this page.*")
    return "\n\n".join(parts) + "\n"


def draw(name: str, done: list[tuple[Cell, Done | None]]) -> None:
    """Write the pictures of a tutorial."""
    from .picture import as_svg

    figures = [given.figure for _, given in done if given is not None and given.figure is not None]
    for number, figure in enumerate(figures, 1):
        for shade, template in (("light", "plotly_white"), ("dark", "plotly_dark")):
            shown = type(figure)(figure)
            title = "<br>".join(wrap(figure.layout.title.text or "", TITLE_WIDTH))
            shown.update_layout(title={"text": title, "font": {"size": 14}}, margin={"t": 75, "b": 50, "r": 20},
                                template=template, font={"family": "sans-serif", "size": 13},
                                paper_bgcolor="rgba(0,0,0,0)", plot_bgcolor="rgba(0,0,0,0)")
            path = SCRIPTS[name].parent / "pictures" / f"{name}_{number}-{shade}.svg"
            path.parent.mkdir(exist_ok=True)
            path.write_text(as_svg(shown.to_json()), encoding="utf-8")
            print(f"{path.name}: {path.stat().st_size / 1000:.0f} kB")
            if path.stat().st_size > LARGEST_PICTURE:
                raise ValueError(f"{path.name} is larger than {LARGEST_PICTURE / 1000:.0f} kB")


def main(names: list[str]) -> int:
    """Write the pages of these scripts, or of all."""
    if unknown := set(names) - set(SCRIPTS):
        raise SystemExit(f"no script {', '.join(sorted(unknown))}; there are {', '.join(SCRIPTS)}")
    for name in names or SCRIPTS:
        done = run(name)
        SCRIPTS[name].with_suffix(".md").write_text(page(name, done), encoding="utf-8")
        draw(name, done)
        print(f"{name}.md")
    (DOCS / "gallery/index.md").write_text(gallery(), encoding="utf-8")
    return 0


def gallery() -> str:
    """Return the first page of the gallery: a picture and a title for each example."""
    cards = []
    for name, path in SCRIPTS.items():
        title = re.search(r"^# # (?:\d+\. )?(.*)$", path.read_text(encoding="utf-8"), re.M)
        place = "" if path.parent.name == "gallery" else "../tutorials/"
        assert title is not None
        pictures = "".join(f"![{title[1]}]({place}pictures/{name}_1-{shade}.svg#only-{shade})"
                           for shade in ("light", "dark"))
        cards.append(f"<div markdown>\n{pictures}\n\n[{title[1]}]({place}{name}.md)\n</div>")
    return ("# Gallery\n\nEvery example is a script that runs with the package alone, on SYNTHETIC flights. The\n"
            "extras `report` and `identification` are needed, `mpc` and `control` for MPC and the linear model.\n\n"
            "On real flights: [public simulators that shipped wrong](shipped/index.md), before and after their\n"
            "correction.\n\n"
            f'<div class="cards" markdown>\n{chr(10).join(cards)}\n</div>\n')


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
