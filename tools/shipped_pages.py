"""Write the gallery's pages of simulators that shipped wrong: ``python -m tools.shipped_pages [SHIPPED.json]``.

With the result of ``nanobench prove --shipped``, docs/figures/shipped.json is written first. Pages, pictures and the
overview come from that file and from the facts of the cases.
"""

import json
import sys
from html import escape
from pathlib import Path
from typing import Any

from identification.prove.shipped.shipped_cases import ANOTHER, GEOMETRY, NOT_ASKED, ShippedCase, shipped_cases
from tools.figures import collect
from tools.figures.store import FOLDER

DOCS = Path(__file__).resolve().parents[1] / "docs"
PLACE = DOCS / "gallery/shipped"
SOURCE = "shipped"
SHADES = (("light", ("#222222", "#c0504d", "#2e75b6", "#70a040")),
          ("dark", ("#dddddd", "#e07a76", "#6fb1e8", "#a5cf7a")))
"""Colours of the text, and of bars as shipped, with the identified correction and with the makers'."""
GROUP, FLOOR, HIGHEST = 185, 300, 205
"""Pixels: width of a group of bars, baseline, height of the tallest bar."""
BARS = (("as shipped", "shipped"), ("identified correction", "identified"), ("makers' correction", "corrected"))
RIGHT_ANSWERS = {ANOTHER: "that the simulator is of another vehicle",
                 GEOMETRY: "that the motor order or the spins are wrong, before any physics"}
LONGEST = 100
"""Characters of a line of a page, about."""


def stored(path: Path = FOLDER / f"{SOURCE}.json") -> dict[str, Any]:
    """Stored results by case."""
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return found


def take(result: Path) -> None:
    """Store a result of ``nanobench prove --shipped`` as the other tables' numbers are stored."""
    spec = collect.specs()[SOURCE]
    collect.save(SOURCE, collect.collect(SOURCE, spec, json.loads(result.read_text(encoding="utf-8"))))


def page(case: ShippedCase, figures: dict[str, Any], origin: str) -> str:
    """The page of a case; ``figures``: its stored results."""
    links = ", ".join(f"[{short(url)}]({url})" for url in case.threads)
    parts = [f"# {case.simulator}: {case.what}", f"{sentence(case.story)} Thread: {links}.",
             f"Shipped: {case.wrong}. Right: {case.right}."]
    if figures.get("right") is None:
        why = case.reason or figures.get("reason") or "It was not diagnosed"
        return "\n\n".join([*parts, "## Not judged", sentence(why), footer(origin)]) + "\n"
    flights = f"{len(figures['flights'])} real flights ({figures['judged_s']:.0f} s judged)"
    parts += [f"## Before and after\n\n{sentence(case.made)} It was diagnosed on {flights}: {figures['credit']}. "
              "The nominal simulator was fitted to other flights."]
    if figures["half_second"]:
        alt = (f"Prediction errors of {case.simulator} after half a second. Bars: as shipped, with the correction that "
               "the diagnosis identified, and with the makers' correction.")
        parts += [f"![{alt}](pictures/{case.name}-{shade}.svg#only-{shade})" for shade, _ in SHADES]
    if figures["worst"] is not None:
        parts.append(numbers(figures["worst"]))
    parts += ["## What the diagnosis reports", quote(figures["before"]),
              f"After the makers' correction:\n\n{quote(figures['after'])}", "## What was right",
              judged(case, figures), footer(origin)]
    return "\n\n".join(parts) + "\n"


def numbers(worst: dict[str, Any]) -> str:
    """The error that the shipped value raises most, as a table."""
    cells = ["–" if worst[key] is None else f"{worst[key]:.3g} {worst['unit']}" for _, key in BARS]
    head = " | ".join(label for label, _ in BARS)
    return (f"| error of the {worst['quantity']} after {worst['ahead_s']:g} s | {head} |\n| --- | --- | --- | --- |\n"
            f"| mean of the flights | {' | '.join(cells)} |")


def judged(case: ShippedCase, found: dict[str, Any]) -> str:
    """What of the answer was right and what was not, as a list."""
    lines = []
    if case.answer in RIGHT_ANSWERS:
        lines.append(f"The right answer is {RIGHT_ANSWERS[case.answer]}: {yes(found['identified'])}.")
    for known in found["known"]:
        terms = " or ".join(f"`{t}`" for t in known["terms"])
        lines.append(f"Known error {terms}: {'identified' if known['by'] else 'not identified'}.")
        if known["value"] is not None:
            low, high = known["ci95"]
            lines.append(f"Size of `{known['parameter']}`: {known['value']:.4g}, 95 % interval {low:.4g} to "
                         f"{high:.4g}; right is {known['true']:.4g}. The size is "
                         f"{'inside' if known['inside'] else 'not inside'}.")
    if not found["visible"]:
        lines.append("Predictions of these flights hardly show the error, so it may stay unidentified.")
    lines.append(f"Other effects identified as shipped: {listed(found['false'])}.")
    lines.append(f"Identified after the correction although right there: {listed(found['again'])}.")
    verdict = "The answer is right." if found["right"] else f"The answer is wrong: {found['why']}."
    return "\n".join(f"- {line}" for line in lines) + f"\n\n**{verdict}**"


def yes(right: bool) -> str:
    """In words."""
    return "given" if right else "not given"


def listed(terms: list[str]) -> str:
    """Terms, or ``none``."""
    return ", ".join(f"`{t}`" for t in terms) or "none"


def sentence(text: str) -> str:
    """With a full stop."""
    return text if text.endswith(".") else f"{text}."


def quote(text: str) -> str:
    """As the tool printed it."""
    return f"```text\n{folded(text)}\n```"


def folded(text: str) -> str:
    """Lines of about LONGEST characters."""
    lines, line = [], ""
    for word in text.split():
        if line and len(line) + 1 + len(word) > LONGEST:
            lines.append(line)
            line = word
        else:
            line = f"{line} {word}".strip()
    return "\n".join([*lines, line])


def short(url: str) -> str:
    """A link's text."""
    return url.partition("://")[2].removeprefix("github.com/").rstrip("/")


def footer(origin: str) -> str:
    """How the page was made."""
    return f"*{origin}. `python -m tools.shipped_pages` writes this page.*"


def origin_of(source: dict[str, Any]) -> str:
    """Where the numbers come from."""
    return f"{source['data']}; `{source['command']}`, version {source['version']}, {source['date']}"


def draw(case: ShippedCase, figures: dict[str, Any]) -> None:
    """Write the light and the dark picture: errors after half a second, relative to the simulator as shipped."""
    for shade, colours in SHADES:
        path = PLACE / "pictures" / f"{case.name}-{shade}.svg"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(picture(f"{case.simulator}: error 0.5 s ahead", figures["half_second"], colours),
                        encoding="utf-8")


def picture(title: str, later: list[dict[str, Any]], colours: tuple[str, ...]) -> str:
    """Grouped bars as SVG. ``colours``: of the text, and of each kind of bar."""
    text, *kinds = colours
    tallest = 100.0 * max(e[key] / e["shipped"] for e in later for _, key in BARS if e[key] is not None)
    parts = [f'<text x="20" y="24" font-size="15">{escape(title)}, in % of the simulator as shipped</text>']
    for k, ((label, _), colour) in enumerate(zip(BARS, kinds, strict=True)):
        parts.append(f'<rect x="{20 + 200 * k}" y="38" width="12" height="12" fill="{colour}"/>'
                     f'<text x="{38 + 200 * k}" y="49">{escape(label)}</text>')
    for i, error in enumerate(later):
        left = 30 + i * GROUP
        for k, ((_, key), colour) in enumerate(zip(BARS, kinds, strict=True)):
            x = left + k * 50
            if error[key] is None:
                parts.append(f'<text x="{x + 20}" y="{FLOOR - 4}" text-anchor="middle">–</text>')
                continue
            share = 100.0 * error[key] / error["shipped"]
            high = HIGHEST * share / tallest
            parts.append(f'<rect x="{x}" y="{FLOOR - high:.1f}" width="40" height="{high:.1f}" fill="{colour}"/>'
                         f'<text x="{x + 20}" y="{FLOOR - high - 5:.1f}" text-anchor="middle">{share:.0f}</text>')
        parts.append(f'<text x="{left + 70}" y="{FLOOR + 20}" text-anchor="middle">{error["quantity"]}</text>'
                     f'<text x="{left + 70}" y="{FLOOR + 38}" text-anchor="middle" font-size="11">100 % = '
                     f'{error["shipped"]:.3g} {error["unit"]}</text>')
    width = 40 + max(3, len(later)) * GROUP
    return (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {FLOOR + 50}" width="{width}" '
            f'height="{FLOOR + 50}" font-family="sans-serif" font-size="13" fill="{text}">\n' + "\n".join(parts) +
            f'\n<path d="M20 {FLOOR}H{width - 20}" stroke="{text}" fill="none"/>\n</svg>\n')


def overview(cases: list[ShippedCase], figures: dict[str, Any], origin: str) -> str:
    """The first page: one table."""
    rows = []
    for case in cases:
        found = figures["case"][case.name]
        right = found.get("right")
        result = "not applicable" if case.answer == NOT_ASKED else "not judged" if right is None else (
            "right" if right else "wrong")
        why = found.get("why") or ""
        rows.append(f"| [{case.simulator}]({case.name}.md) | {case.what} | {case.wrong} | {case.right} | {result} | "
                    f"{why} |")
    every = figures["all"]
    counts = (f"{every['right']} of {every['n']} answers are right (95 %: {100 * every['ci95'][0]:.0f} to "
              f"{100 * every['ci95'][1]:.0f} %). A false effect was identified in {every['false']} cases.")
    return "\n".join(["# Simulators that shipped wrong", "",
                      "Public simulators of small quadrotors whose makers or users found a parameter wrong. Each is",
                      "diagnosed on real flights, as shipped and after its makers' correction. Nobody here chose the",
                      "errors, and wrong answers are shown, too.", "", counts, "",
                      "| simulator | what was wrong | shipped | right | answer | why not |",
                      "| --- | --- | --- | --- | --- | --- |", *rows, "", footer(origin), ""])


def main(arguments: list[str]) -> int:
    """Take over a result where one is given, then write all pages."""
    if arguments:
        take(Path(arguments[0]))
    source = stored()
    figures = source["figures"]
    origin = origin_of(source)
    cases = shipped_cases()
    PLACE.mkdir(parents=True, exist_ok=True)
    for case in cases:
        found = figures["case"][case.name]
        (PLACE / f"{case.name}.md").write_text(page(case, found, origin), encoding="utf-8")
        if found.get("half_second"):
            draw(case, found)
    (PLACE / "index.md").write_text(overview(cases, figures, origin), encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
