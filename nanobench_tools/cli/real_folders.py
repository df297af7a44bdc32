"""Real folders for ``nanobench prove --real`` and ``nanobench diagnose --normal``: reading them, and their tables."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError
from ..steps.options import Options, one_line
from ..steps.show import data_word, rich_table

if TYPE_CHECKING:
    from identification.prove.folder_score import FolderProof

    from ..flight import Flight

NORMAL = "normal"


def real_folders(options: Options, place: Path, normal: str | None
                 ) -> tuple[dict[str, list[Flight]], list[Flight], bool]:
    """(flights by folder, normal flights, whether these are of another place) of ``--real DIR --normal NAME``.

    The normal folder is one of DIR, ``normal`` by default, or a folder elsewhere; then all of DIR is diagnosed.
    """
    if not place.is_dir():
        raise InputError(f"--real {place}", "is no folder", "give one that holds a folder per condition")
    inside = sorted(entry for entry in place.iterdir() if entry.is_dir() and not entry.name.startswith("."))
    if not inside:
        raise InputError(f"--real {place}", "holds no folders", "one per condition is needed")
    name = normal or NORMAL
    elsewhere = name not in {entry.name for entry in inside}
    if elsewhere and (normal is None or not os.path.isdir(normal)):
        raise InputError(f"--real {place}", f"has no folder {name!r}",
                         "--normal names the one of unchanged flights, or a folder elsewhere")
    reference = Path(normal) if elsewhere and normal is not None else place / name
    flights = options.load([*inside, *([reference] if elsewhere else [])])
    found: dict[Path, list[Flight]] = {entry: [] for entry in [*inside, reference]}
    for flight in flights:
        path = Path(flight.provenance.path)
        home = next(entry for entry in sorted(found, key=lambda p: -len(p.parts)) if entry in path.parents)
        found[home].append(flight)
    usual = found.pop(reference)
    return {entry.name: mine for entry, mine in found.items()}, usual, elsewhere


def copies_between(groups: Mapping[str, Sequence[Flight]], copies: Sequence[Sequence[str]]) -> dict[str, str]:
    """{flight: why} of recordings that hold the numbers of another one: the first group keeps it."""
    home = {f.name: name for name, flights in groups.items() for f in flights}
    order = [f.name for flights in groups.values() for f in flights]
    found = {}
    for group in copies:
        first, *others = sorted((n for n in group if n in home), key=order.index) or [""]
        for name in others:
            found[name] = f"holds the same numbers as {first} of {home[first]}"
    return found


def show_folders(options: Options, found: FolderProof) -> None:
    """One row per folder, one per normal flight left out; then what they add up to."""
    table = rich_table(f"Folders diagnosed blind against {len(found.normal)} normal flights, {data_word(options)}",
                       HEADS[:1], wrapped=HEADS[1:])
    for row in rows(found):
        table.add_row(*row)
    options.detail(table)
    for line in sentences(found):
        options.detail(line)


HEADS = ("folder", "truth", "verdict", "motors", "right", "thrust commanded of motors 1..4, %", "sd %", "found at it")


def rows(found: FolderProof) -> list[tuple[str, ...]]:
    """Of every folder and every normal flight left out: texts under HEADS."""
    lines: list[tuple[str, ...]] = []
    for case in found.cases:
        trim, size = case.trim, case.size
        said = case.cause or (" or ".join(case.causes) if case.causes else case.outcome)
        lines.append((one_line(case.case), ", ".join(case.truth) or "-", said,
                      ", ".join(map(str, case.motors_named)) or "-",
                      "yes" if case.right else "among several" if case.in_class else "FALSE" if case.false_name else
                      "no, below the stated size" if case.below else "no",
                      " ".join(f"{c:+.1f}" for c in trim["change_percent"]) if trim else "-",
                      f"{trim['sd_percent']:.1f}" if trim else "-",
                      ", ".join(f"{v:.1f} %" for v in size.loss_percent) if size else "-"))
    return lines


def sentences(found: FolderProof) -> list[str]:
    """What a proof on folders adds up to."""
    summary, lines = found.summary, []
    for kind, row in summary.by_kind.items():
        among = f", {row.in_class} more among causes identified together" if row.in_class else ""
        lines.append(f"{kind}: right {row.right} of {row.n}{among}, {row.below} below what these flights can show, "
                     f"{row.false_names} false names")
    alarms = summary.false_alarms
    lines.append(f"normal flights judged by the others: {alarms.right} false alarms of {alarms.n}"
                 + (f" (95 %: {alarms.ci95[0]:.0%} to {alarms.ci95[1]:.0%})" if alarms.ci95 else ""))
    dose = summary.dose
    for words, answer in (("one motor cut", dose.one_motor), ("all motors cut", dose.all_motors)):
        if answer.spearman is not None:
            lines.append(f"dose and response, {words}: Spearman {answer.spearman:.2f}, n = {answer.n}")
    for cause, least in found.power.items():
        if (size := least.minimum_detectable) is not None:
            lines.append(f"smallest swing that would be found: {size:.2f} {least.unit}" if cause == "slung" else
                         f"smallest {cause} that would be named: {size:.1f} {least.unit}")
    for name in found.unlabelled:
        lines.append(f"{one_line(name)}: has no label, it was diagnosed and is not scored")
    if found.without_folder:
        lines.append(f"labels without a folder here: {one_line(', '.join(found.without_folder))}")
    return lines
