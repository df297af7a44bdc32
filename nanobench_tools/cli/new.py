"""``nanobench new``: a method of one's own to begin with, with its test."""

import importlib.util
import keyword
import re
from pathlib import Path

import click

from ..errors import InputError, UsageError, unknown_name
from ..steps.options import Options
from .closing import close
from .shared_options import shared_options

STARTERS = Path(__file__).resolve().parents[1] / "starters"
KINDS = {"estimator": ("own_estimator", "GyroAndLine", ("estimate", "--protocol", "aided", "--method")),
         "predictor": ("own_predictor", "StraightOn", ("sysid", "--fit", "none", "--method")),
         "controller": ("own_controller", "TiltAndTurn", ("simulate", "--out", "flown", "--controller"))}
"""Kind to begin -> module and class of the example, and the command that takes it."""


@click.command()
@click.argument("kind", metavar="KIND")
@click.argument("name", metavar="NAME")
@shared_options("data", "jobs", "scheduler", "seed", "clock", "columns")
def new(options: Options, kind: str, name: str) -> int:
    """Write a working estimator, predictor or controller of your own into this folder (or --out DIR), with its test.

    \b
    nanobench new estimator my_estimator             writes my_estimator.py and test_my_estimator.py
    python -m pytest test_my_estimator.py            passes; keep it passing while you change the file
    nanobench estimate --protocol aided --method my_estimator:MyEstimator
    """
    from ..sources.discover import default_data

    if kind not in KINDS:
        raise unknown_name("kind", kind, KINDS)
    check_name(name)
    folder = options.out or Path()
    files = {folder / file: text for file, text in starter(kind, name).items()}
    for path in files:
        if path.exists():
            raise InputError(str(path), "is there already", "give another name or remove it")
    for path, text in files.items():
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        except OSError as error:
            raise InputError(str(path), f"cannot be written ({error.strerror})", "give another place") from None
    options.out = None
    written = " and ".join(map(str, files))
    where = "" if folder == Path() else f" in {folder}"
    verb, *rest = KINDS[kind][2]
    flights = [] if verb == "simulate" or default_data() else ["FLIGHTS"]
    close(options, f"{written} written; its test: python -m pytest {next(reversed(files))}", f"score it{where}",
          "nanobench", verb, *flights, *rest, f"{name}:{class_name(name)}")
    return options.finish("new", {"kind": kind, "name": name, "files": [str(path) for path in files]})


def check_name(name: str) -> None:
    """UsageError for what is no name of a module, or that of one Python knows already."""
    if not name.isidentifier() or keyword.iskeyword(name) or name != name.lower():
        near = re.sub(r"\W+", "_", re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name.removesuffix(".py"))).strip("_").lower()
        raise UsageError(f"{name!r} is no name for a module: small letters, digits and _"
                         + (f"; did you mean {near!r}?" if near.isidentifier() else ""))
    if importlib.util.find_spec(name) is not None and not Path(f"{name}.py").exists():
        raise UsageError(f"{name!r} is the name of a package that is installed; give another")


def class_name(name: str) -> str:
    """
    >>> class_name("my_estimator")
    'MyEstimator'
    """
    return "".join(part.capitalize() for part in name.split("_")) or "Own"


def starter(kind: str, name: str) -> dict[str, str]:
    """File name -> text: the example of this kind under another name, and its test."""
    module, example, _ = KINDS[kind]
    label = re.sub(r"(?<!^)(?=[A-Z])", "_", example).lower()
    found = {}
    for file in (f"{module}.py", f"test_{module}.py"):
        text = (STARTERS / f"{file}.txt").read_text(encoding="utf-8")
        for old, today in ((module, name), (example, class_name(name)), (label, name)):
            text = text.replace(old, today)
        found[file.replace(module, name)] = text
    return found
