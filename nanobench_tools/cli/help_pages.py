"""``nanobench VERB --help``: one screen with the purpose, an example and the common options; with --verbose all."""

import re
from collections.abc import Sequence

import click

from ..tables.terminal import folded
from .closing import WORDS

PATHS = "Recordings: files or folders."
NARROW, WIDE = 50, 100
"""Columns a help page has at least and at most."""
SHORT_DEFAULT = 30
"""Longest default, in characters, on the first screen."""
OPTION_COLUMNS = 22
"""Widest column of options on the first screen; the text of a longer one begins on the next line."""

COMMON: dict[str, tuple[str, ...]] = {
    "run": ("--out", "--columns", "--clock", "--practice", "--jobs", "--verbose"),
    "audit": ("--out", "--json", "--columns", "--verbose"),
    "estimate": ("--protocol", "--method", "--trajectory-dir", "--clock", "--columns", "--out"),
    "sysid": ("--out", "--method", "--train", "--test", "--fit", "--mass", "--columns"),
    "thrust": ("--train", "--test", "--mass", "--columns", "--out", "--verbose"),
    "motors": ("--mass", "--train", "--test", "--columns", "--out", "--verbose"),
    "noise": ("--out", "--columns", "--json", "--verbose"),
    "control": ("--plant", "--controller", "--simulator", "--clock", "--out"),
    "tune": ("--controller", "--budget", "--simulator", "--trajectory", "--plants", "--out"),
    "diagnose": ("--simulator", "--simulated", "--normal", "--mass", "--out", "--verbose"),
    "prove": ("--cases", "--kind", "--concealed", "--corrupted", "--real", "--out"),
    "simulate": ("--out", "--flights", "--trajectory", "--controller", "--seconds", "--serve"),
    "fly": ("--controller", "--trajectory", "--speed", "--uri", "--mocap", "--record", "--dry-run"),
    "record": ("--uri", "--out", "--mocap", "--seconds", "--blocks", "--export"),
    "convert": ("--to", "--out", "--columns", "--mocap"),
    "report": ("--out", "--columns", "--verbose"),
}
"""Verb -> its common options, for the first screen of its help. The whole page of a verb that is not here is short."""


def help_option(verb: str, example: str) -> click.Option:
    """``--help`` of a verb: its common options; with ``--verbose`` the whole page."""
    def shown(context: click.Context, parameter: click.Parameter, wanted: bool) -> None:
        if wanted and not context.resilient_parsing:
            every = verb not in COMMON or "--verbose" in context.meta.get(WORDS, ())
            click.echo(context.command.get_help(context) if every else first_screen(verb, example, context))
            context.exit()

    return click.Option(["-h", "--help"], is_flag=True, is_eager=True, expose_value=False, callback=shown,
                        help="Show this page." if verb not in COMMON else
                        "Show the common options; with --verbose all of them.")


def first_screen(verb: str, example: str, context: click.Context) -> str:
    """The purpose of a verb, an example and its common options."""
    width = min(max(context.make_formatter().width, NARROW), WIDE)
    command = context.command
    options = {name: option for option in command.params if isinstance(option, click.Option) for name in option.opts}
    purpose = " ".join((command.help or "").split("\n\n")[0].split())
    described = [_described(options[name]) for name in COMMON[verb]]
    if "--data" in options:
        described.insert(0, ("PATH", PATHS))
    count = len({option.name for option in options.values()})
    names = [f"Names that options take: nanobench {verb} --list"] if "--list" in options else []
    return "\n".join([command.get_usage(context), "", *(f"  {line}" for line in folded(purpose, width - 2)), "",
                      f"  Example: {example}", "", "Common options:", *_listed(described, width), "", *names,
                      f"All {count} options and the details: nanobench {verb} --help --verbose"])


def _described(option: click.Option) -> tuple[str, str]:
    """(option with its value, first sentence of its help and the one about its default)."""
    first, *others = re.split(r"(?<=\.) (?=[A-Z])", " ".join((option.help or "").split()))
    default = [text for text in others if text.startswith("Default:") and len(text) <= SHORT_DEFAULT]
    name, text = option.opts[0], " ".join([first, *default])
    if option.is_flag:
        return name, text
    value = option.metavar or ""
    if isinstance(option.type, click.Choice) and not value:
        value = "|".join(option.type.choices)
        value = value if len(name) + len(value) < OPTION_COLUMNS else name.lstrip("-").upper()
    return f"{name} {value or 'N'}", text


def _listed(described: Sequence[tuple[str, str]], width: int) -> list[str]:
    indent = 4 + max([len(name) for name, _ in described if len(name) <= OPTION_COLUMNS], default=0)
    lines = []
    for name, text in described:
        parts = folded(text, width - indent)
        if len(name) + 4 > indent:
            lines.append(f"  {name}")
        else:
            lines.append(f"  {name}".ljust(indent) + parts.pop(0) if parts else f"  {name}")
        lines += [" " * indent + part for part in parts]
    return lines
