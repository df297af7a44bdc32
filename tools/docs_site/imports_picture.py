"""The page "Who imports whom": a picture of the packages in rows, from the imports of the code."""

from collections import defaultdict
from pathlib import Path

from tools.imports import GROUND, METHODS, import_graph, modules, package_graph, package_of

WIDTH, ROW, BOX, HIGH, SMALLEST = 1240, 64, 148, 36, 100
"""Pixels of the picture, of a row, of a box; lines of code of a package that is drawn."""
BASE = "ground"


def place_of(package: str) -> str:
    """Name in the picture: what everything uses is one box, and so are all estimators and all controllers."""
    top, _, inside = package.partition(".")
    if top in METHODS:
        return package if top == "identification" and inside else top
    return inside if "." in inside or (inside and inside not in {*GROUND, *_single_files()}) else BASE


def _single_files() -> set[str]:
    root = Path(__file__).resolve().parents[2] / "nanobench_tools"
    return {path.stem for path in root.glob("*.py")}


def places() -> tuple[dict[str, set[str]], dict[str, int]]:
    """Box -> boxes that it imports, and its lines of code."""
    graph = defaultdict[str, set[str]](set)
    for package, others in package_graph(import_graph()).items():
        graph[place_of(package)] |= {place_of(other) for other in others} - {place_of(package)}
    lines = defaultdict[str, int](int)
    for module, path in modules().items():
        lines[place_of(package_of(module))] += len(path.read_text("utf-8").splitlines())
    drawn = {name for name in graph if lines[name] >= SMALLEST}
    return {name: graph[name] & drawn for name in sorted(drawn)}, dict(lines)


def rows_of(graph: dict[str, set[str]]) -> dict[str, int]:
    """Row of every box: one above the highest that it imports. Raises RecursionError for a circle."""
    found: dict[str, int] = {}

    def row(name: str) -> int:
        if name not in found:
            found[name] = 1 + max((row(other) for other in graph[name]), default=-1)
        return found[name]

    for name in graph:
        row(name)
    return found


def direct(graph: dict[str, set[str]]) -> set[tuple[str, str]]:
    """Imports that no longer way explains (transitive reduction)."""
    reached: dict[str, set[str]] = {}
    for name in sorted(graph, key=rows_of(graph).__getitem__):
        reached[name] = graph[name].union(*(reached[other] for other in graph[name]))
    return {(name, other) for name, others in graph.items() for other in others
            if not any(other in reached[between] for between in others)}


def picture() -> str:
    """SVG in the colours of the page."""
    graph, lines = places()
    row, arrows = rows_of(graph), direct(graph)
    top = max(row.values())
    x: dict[str, float] = {}
    for level in range(top + 1):
        names = sorted((n for n in graph if row[n] == level), key=lambda n: (
            sum(x[o] for m, o in arrows if m == n) / max(sum(m == n for m, _ in arrows), 1), n))
        x |= {name: WIDTH * (k + 0.5) / len(names) for k, name in enumerate(names)}
    y = {name: 8 + ROW * (top - row[name]) for name in graph}
    parts = [f'<svg viewBox="0 0 {WIDTH} {ROW * top + HIGH + 16}" role="img" xmlns="http://www.w3.org/2000/svg" '
             f'aria-label="{len(graph)} packages in {top + 1} rows. Every line leads down, from a package to one that '
             f'it imports." style="width: 100%; font: 12px sans-serif; fill: currentColor">']
    parts += [f'<path d="M{x[a]:.0f} {y[a] + HIGH}C{x[a]:.0f} {y[a] + HIGH + 30} {x[b]:.0f} {y[b] - 30} {x[b]:.0f} '
              f'{y[b]}" fill="none" stroke="currentColor" stroke-opacity=".35"/>' for a, b in sorted(arrows)]
    for name in graph:
        parts.append(
            f'<g transform="translate({x[name] - BOX / 2:.0f} {y[name]})" text-anchor="middle">'
            f'<rect width="{BOX}" height="{HIGH}" rx="4" stroke="currentColor" '
            f'style="fill: var(--md-code-bg-color, #eee)"/>'
            f'<text x="{BOX / 2}" y="15">{name}</text>'
            f'<text x="{BOX / 2}" y="30" font-size="10" fill-opacity=".7">{lines[name]:,} lines</text></g>')
    return "".join([*parts, "</svg>"])


def page() -> str:
    return "\n\n".join([
        "# Who imports whom",
        "Each box is a package, with its lines of code. A line leads down to a package that is imported; imports that "
        "a longer way explains are left out. A test fails where a line would lead up. `ground` is what everything "
        f"uses: {', '.join(f'`{name}`' for name in GROUND)}, and the single files beside them.",
        f'<div style="overflow-x: auto"><div style="min-width: 50rem">{picture()}</div></div>',
        "The rules behind it are in [How nanobench is built](../project/architecture.md)."])
