"""Pages of the site that are written from the code at each build, so that they cannot differ from it."""

import ast
import dataclasses
import functools
import importlib
import inspect
from collections import defaultdict
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np

from nanobench_tools.auditing.faults.kinds import kinds
from nanobench_tools.cli.main import VERBS, cli
from nanobench_tools.lookup import registry

from . import imports_picture, peers
from .docstring_text import cell, entries, markdown, sections

ROOT = Path(__file__).resolve().parents[2]
PACKAGE: Any = importlib.import_module("nanobench_tools")
PACKAGES = ("nanobench_tools", "estimators", "controllers", "identification")

FUNCTIONS = {
    "Recordings": ("sample", "load", "load_flight", "simulate", "audit", "report"),
    "Where was it": ("estimate", "tune_onboard", "compare"),
    "What physics does it obey": ("fit", "thrust", "motors"),
    "How would another controller fly it": ("control", "tune"),
    "Where is my simulator wrong": ("diagnose", "prove"),
}
"""Functions of ``nb`` in the order of the reference; a test checks that none is missing."""

RESULT_FILES = {
    "audit.json": ("nanobench audit", ["nanobench_tools.auditing.recording_audit:Audit", "nanobench_tools.flight:Fault",
                                       "nanobench_tools.flight:Span"]),
    "estimate.json": ("nanobench estimate", ["nanobench_tools.steps.result_bodies:EstimateBody",
                                             "nanobench_tools.protocols.result_rows:EstimateRow",
                                             "nanobench_tools.steps.result_bodies:TakenOut"]),
    "tune_onboard.json": ("nanobench estimate --tune-onboard",
                          ["nanobench_tools.protocols.onboard_tuning:OnboardTuning",
                           "nanobench_tools.protocols.onboard_tuning:TuningRow"]),
    "control.json": ("nanobench control", ["nanobench_tools.steps.result_bodies:ControlBody",
                                           "nanobench_tools.protocols.task2:TrackingRow"]),
    "sysid.json": ("nanobench sysid", ["nanobench_tools.steps.result_bodies:SysidBody",
                                       "nanobench_tools.protocols.task1:PredictionRow"]),
    "verdict.json": ("nanobench diagnose", ["identification.mismatch.verdict"]),
    "thrust.json": ("nanobench thrust", ["identification.thrust.thrust_result:ThrustResult"]),
}
"""Result file -> its command, and the classes whose fields are its keys or the module whose docstring lists them."""


def _table(head: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    lines = ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)])


def place_of(name: str) -> str:
    """Return the full path of a public name of ``nb``."""
    module = next(module for module, names in PACKAGE._PLACES.items() if name in names)
    return f"nanobench_tools.{module}.{name}"


def python_functions() -> str:
    parts = ["# Python functions", "`import nanobench_tools as nb`. Every function raises `nb.InputError` for a bad "
             "file or column, `nb.UsageError` for a bad argument, and `nb.MissingExtraError` for a missing extra."]
    for title, names in FUNCTIONS.items():
        parts.append(f"## {title}")
        parts += [f"::: {place_of(name)}" for name in names]
    return "\n\n".join(parts)


def python_classes() -> str:
    functions = {name for names in FUNCTIONS.values() for name in names}

    def of(package: str) -> list[str]:
        return sorted(name for name in PACKAGE.__all__ if name not in functions and name != "__version__"
                      and place_of(name).split(".")[1] == package)

    return "\n\n".join(["# Python classes", "## Results", *(f"::: {place_of(n)}" for n in of("api")),
                        "## Recordings", *(f"::: {place_of(n)}" for n in of("flight") if n != "make_stream"),
                        "::: nanobench_tools.flight.make_stream",
                        "## Errors", *(f"::: {place_of(n)}" for n in of("errors"))])


def protocols() -> str:
    from nanobench_tools import methods

    names = [name for name, value in vars(methods).items()
             if inspect.isclass(value) and value.__module__ == methods.__name__]
    head = ("# Protocols of methods\n\nAn estimator, predictor or controller is any object with these attributes. "
            "[Your own methods](../own_methods.md) has examples.")
    return "\n\n".join([head, *(f"::: nanobench_tools.methods.{name}" for name in names)])


def command_line() -> str:
    parts = ["# Command line", "What each verb prints for `--help --verbose`. See also "
             "[the overview](../command_line.md)."]
    for verb, (sentence, example) in VERBS.items():
        context = click.Context(cli, info_name="nanobench", terminal_width=96, max_content_width=96)
        command = cli.get_command(context, verb)
        assert command is not None
        text = command.get_help(click.Context(command, parent=context, info_name=verb, terminal_width=96,
                                              max_content_width=96))
        parts.append(f"## nanobench {verb} {{ #{verb} }}\n\n{sentence}\n\n```sh\n{example}\n```\n\n"
                     f"```text\n{text}\n```")
    return "\n\n".join(parts)


def faults() -> str:
    """Every kind of fault: what it is, how it is found, its smallest size, what the audit does with the rows."""
    done = {"cut": "The rows are not used.", "corrected": "The values are corrected with `--clock retimed`.",
            "noted": "The rows are kept and the fault is reported.", "information": "For information."}
    rows, parts = [], []
    for name, kind in sorted(kinds().items()):
        rows.append((f"[`{name}`](#{name})", cell(kind.sentence), cell(kind.severity)))
        body = markdown(kind.doc.partition(":")[2].strip() if kind.doc.startswith(name) else kind.doc)
        parts.append(f"## {name} {{ #{name} }}\n\n{body[:1].upper()}{body[1:]}\n\n"
                     f"*{done[kind.severity]}*" + (f" Advice: {cell(kind.advice)}." if kind.advice else ""))
    return "\n\n".join(["# Faults of recordings", "What `nanobench audit` looks for.",
                        _table(("kind", "meaning", "its rows"), rows), *parts])


def terms() -> str:
    """Every term: equation, parameters with shape, unit, bounds and typical value, look-alikes, references."""
    rows, parts = [], []
    for name, term in registry.load_all("terms").items():
        rows.append((f"[`{name}`](#{name})", cell(term.sentence)))
        text = term_text(name)
        meaning = entries(text.get("Parameters", ""))
        parameters = _table(("parameter", "shape and unit", "meaning", "bounds", "typical, 40 g vehicle"), [
            (f"`{p.name}`", cell(meaning.get(p.name, (p.unit, ""))[0]), cell(meaning.get(p.name, ("", ""))[1]),
             f"{p.lower:g} .. {p.upper:g}",
             cell(f"{', '.join(f'{v:g}' for v in np.atleast_1d(p.typical))} ({p.source})")) for p in term.parameters])
        confused = "".join(f"\n- `{other}`: {cell(how)}" for other, how in term.confused_with.items())
        parts.append("\n\n".join([
            f"## {name} {{ #{name} }}", markdown(term.sentence), f"```text\n{term.equation}\n```", parameters,
            *([f"Confused with, and the flight or measurement that separates them:\n{confused}"] if confused else []),
            *([f"Not searched for by a diagnosis: it {cell(term.not_asked)}."] if term.not_asked else []),
            *([f"References:\n\n{markdown(text['References'])}"] if "References" in text else [])]))
    head = ("A simulator is a list of these terms. `nanobench diagnose` tests each of them. In the equations, `<-` "
            "replaces the value on its left: F is the force in the world, F_b the force in the body, tau the moment in "
            "the body, T_i, u_i and Omega_i the thrust, input and speed of motor i, spin_i the direction of its yaw "
            "torque, v the velocity, w the body rate. World z is up; body x is forward, y left, z up.")
    return "\n\n".join(["# Physics terms", head, _table(("term", "effect"), rows), *parts])


def term_text(name: str) -> dict[str, str]:
    """Sections of the docstring of a term's file."""
    return sections(importlib.import_module(f"nanobench_tools.physics.terms.{name}").__doc__ or "")


def methods_of(group: str) -> list[tuple[str, str]]:
    return [(name, next(iter(markdown(inspect.getdoc(found) or "").split("\n\n")), ""))
            for name, found in registry.load_all(group).items()]


def methods() -> str:
    parts = ["# Registered methods", "Names for `--method`, `--controller` and the functions of `nb`. "
             "[Add yours](../howto/add_an_estimator.md)."]
    for group, title in (("estimators", "Estimators"), ("predictors", "Predictors"), ("controllers", "Controllers"),
                         ("simulators", "Simulators")):
        parts.append(f"## {title}")
        parts.append(_table(("name", "what it is"), [(f"[`{name}`](#{name})", cell(text))
                                                     for name, text in methods_of(group)]))
        shown: dict[str, str] = {}
        for name, found in registry.load_all(group).items():
            first = shown.setdefault(found.__module__, name)
            file = markdown(inspect.getmodule(found).__doc__ or "")
            parts.append("\n\n".join(filter(None, (
                f"### {name} {{ #{name} }}", _facts(found), markdown(inspect.getdoc(found) or ""), _gains(found),
                "" if "\n" not in file else file if first == name else f"Method and sources: [`{first}`](#{first})."))))
    return "\n\n".join(parts)


def _facts(found: Any) -> str:
    """What the attributes of a method state, in a line."""
    uses = {"as flown": "position and yaw setpoints", "lead": "position and yaw setpoints, sent earlier",
            "preview": "the reference with derivatives, and its future where known",
            "state": "the start state and the inputs", "past": "the start state, the inputs and the past"}
    causal = getattr(found, "causal", None)
    facts = [text for text in (
        "" if causal is None else "Causal." if causal else "It looks ahead.",
        f"A command every {1e3 * found.period_s:g} ms." if hasattr(found, "period_s") else "",
        f"It knows {uses[found.information]}." if getattr(found, "information", None) in uses else "",
        f"Needs {' and '.join(f'`{s}`' for s in found.needs)}." if getattr(found, "needs", ()) else "") if text]
    return f"*{' '.join(facts)}*" if facts else ""


def _gains(found: Any) -> str:
    return "Gains:\n\n" + _table(("gain", "value", "unit", "searched between"), [
        (f"`{name}`", f"{g.value:.4g}", cell(g.unit), f"{g.low:.4g} and {g.high:.4g}")
        for name, g in found.tunable.items()]) if getattr(found, "tunable", None) else ""


def metric_files() -> list[Any]:
    """Modules of the metrics."""
    from nanobench_tools import metrics as package

    return [importlib.import_module(f"{package.__name__}.{path.stem}")
            for path in sorted(Path(package.__path__[0]).glob("*.py")) if path.stem != "__init__"]


def metrics() -> str:
    """Every function of the metrics, by file."""
    head = ("# Metrics\n\nThe scores behind every table, one equation each. All arrays are rows at the same times, in "
            "SI; the unit of a result is in its name or text. `from nanobench_tools.metrics.trajectory import ate`.")
    return "\n\n".join([head, *(f"## `{file.__name__.rpartition('.')[2]}`\n\n::: {file.__name__}\n    options:\n"
                                "      show_root_heading: false\n      show_root_toc_entry: false"
                                for file in metric_files())])


def sources() -> str:
    from nanobench_tools.cli.sources import GOOD_FOR

    parts = ["# Sources", "A file is recognised by its content, not by its name. "
             "[Recordings](../recordings.md) explains how to bring your own.",
             _table(("source", "format", "good for"), [(f"`{n}`", cell(a), cell(b)) for n, (a, b) in GOOD_FOR.items()])]
    for name, kind in registry.load_all("sources").items():
        own = (inspect.getdoc(kind) or "").removeprefix(f"Source ``{name}``").strip(".:; ")
        file = markdown(inspect.getmodule(kind).__doc__ or "")
        parts.append("\n\n".join([f"## {name} {{ #{name} }}", file,
                                  *([f"{markdown(own[:1].upper() + own[1:])}."] if own else [])]))
    return "\n\n".join(parts)


def _load(place: str) -> Any:
    module, _, name = place.partition(":")
    return getattr(importlib.import_module(module), name) if name else importlib.import_module(module)


def schemas() -> str:
    """Keys of the result files, from the classes that are written."""
    parts = ["# Result files", "Every verb writes JSON with `--json FILE` or into `--out DIR`. Each file begins with "
             "`schema`, `version`, `synthetic`, `manifest` and `failed`. Numbers are in SI units unless the key names "
             "another; missing numbers are `null`.", "A simulator is a TOML file: [simulator.toml](#simulator)."]
    for file, (command, places) in RESULT_FILES.items():
        parts.append(f"## {file}\n\nWritten by `{command}`.")
        for place in places:
            found = _load(place)
            text = sections(inspect.getdoc(found) or "")
            meaning = entries(text.pop("Attributes", ""))
            if inspect.ismodule(found):
                parts.append(f"{markdown(text[''])}\n\n" + _table(("key", "type", "meaning"), [
                    (f"`{name}`", cell(kind), cell(body)) for name, (kind, body) in meaning.items()]))
                continue
            rows = [(f"`{f.metadata.get('key', f.name)}`", cell(f"`{f.type}`"), " ".join(filter(None, (
                        cell(meaning.get(f.name, ("", ""))[1]),
                        "Absent where empty." if f.metadata.get("optional") else
                        "Its keys are among these." if f.metadata.get("inline") else ""))))
                    for f in dataclasses.fields(found)]
            parts.append(f"### {found.__name__}\n\n{markdown(text[''])}\n\n"
                         + _table(("key", "type", "meaning"), rows))
    from nanobench_tools.physics import simulator

    parts.append("## simulator.toml { #simulator }\n\n" + markdown(inspect.getdoc(simulator) or ""))
    return "\n\n".join(parts)


@functools.cache
def error_calls() -> dict[str, list[tuple[str, str, str]]]:
    """Return {error class: [(module, message, remedy)]} of every error the code raises, in the order of the files."""
    found: dict[str, list[tuple[str, str, str]]] = defaultdict(list)
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            source = path.read_text(encoding="utf-8")
            if "Error(" not in source:
                continue
            module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
            for node in ast.walk(ast.parse(source)):
                if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) \
                        and node.func.id in ("InputError", "UsageError", "MissingExtraError") and node.args:
                    texts = [_template(argument) for argument in node.args]
                    place, what, remedy = ("", texts[0], "") if node.func.id != "InputError" or len(texts) < 2 else \
                        (texts[0], texts[1], texts[2] if len(texts) > 2 else "")
                    if what.strip("… ;:"):
                        found[node.func.id].append((module, f"{place}: {what}" if place else what, remedy))
    return found


def _template(node: ast.expr) -> str:
    """Return the text of an expression, with … for each value."""
    if isinstance(node, ast.Constant):
        return str(node.value)
    if isinstance(node, ast.JoinedStr):
        return "".join(str(p.value) if isinstance(p, ast.Constant) else "…" for p in node.values)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return _template(node.left) + _template(node.right)
    if isinstance(node, ast.IfExp):
        return f"{_template(node.body)} / {_template(node.orelse)}"
    return "…"


def error_messages() -> str:
    titles = {"InputError": "A file, column or row is wrong", "UsageError": "An argument or option is wrong",
              "MissingExtraError": "An extra is not installed"}
    parts = ["# Error messages", "Every message that the code raises; … is a value of yours. Search this page for the "
             "words between the values. Each message is one line, and the command ends with exit code 2. "
             "[Troubleshooting](../help/troubleshooting.md) explains the common ones."]
    for kind, title in titles.items():
        groups: dict[str, dict[tuple[str, str], None]] = defaultdict(dict)
        for module, message, remedy in error_calls()[kind]:
            groups[".".join(module.split(".")[:2])][message, remedy] = None
        parts.append(f"## {title} (`nb.{kind}`)")
        for group, messages in sorted(groups.items()):
            parts.append(f"### {group} {{ #{kind}-{group} }}\n\n" + _table(
                ("message", "what to do"), [(cell(f"`{_plain(m)}`"), cell(_plain(r))) for m, r in messages]))
    return "\n\n".join(parts)


def _plain(text: str) -> str:
    return " ".join(text.replace("`", "'").split())


PAGES: dict[str, Callable[[], str]] = {
    "reference/functions.md": python_functions,
    "reference/classes.md": python_classes,
    "reference/protocols.md": protocols,
    "reference/command_line.md": command_line,
    "reference/faults.md": faults,
    "reference/terms.md": terms,
    "reference/methods.md": methods,
    "reference/metrics.md": metrics,
    "reference/sources.md": sources,
    "reference/result_files.md": schemas,
    "reference/error_messages.md": error_messages,
    "reference/imports.md": imports_picture.page,
    "peers.md": peers.page,
}
"""Page of the site -> what writes it."""
