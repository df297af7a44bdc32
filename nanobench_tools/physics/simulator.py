"""simulator.toml: a model as a file. Strict on the way in, exact and with units on the way out.

    schema = "nanobench-simulator/1"
    [vehicle]                           keys and units as in ``vehicle``; gravity, input and rate_hz may be left out
    [[terms]]                           one table per effect: its name and its parameters
"""

import re
import tomllib
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from types import MappingProxyType
from typing import Any

from ..errors import InputError, MissingExtraError
from ..lookup import registry
from ..results.result_files import write_bytes
from . import rules
from .model import Model, find_term
from .vehicle import UNITS, Vehicle

SCHEMA = "nanobench-simulator/1"
MAY_BE_MISSING = ("gravity_m_s2", "input", "rate_hz")
_HEADER = re.compile(r"\s*\[(\[)?\s*([^\[\]]+?)\s*\]\]?\s*(#.*)?$")
_KEY = re.compile(r"\s*([A-Za-z0-9_\-.\"' ]+?)\s*=")


def read_simulator(path: Path | str) -> Model:
    """A model from a file; raises InputError with file, line and key of the first that is wrong."""
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(str(path), f"cannot be read: {error.strerror}", "give a simulator.toml") from None
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        line = data[:error.start].count(b"\n") + 1
        raise InputError(f"{path}: line {line}", "bytes that are not UTF-8", "save it as UTF-8 text") from None
    return loads(text, str(path))


def read_quadrotor(path: Path | str, what: str) -> Model:
    """``read_simulator`` for those who know four motors only: ``what``. InputError for another number of rotors."""
    model = read_simulator(path)
    if model.rotors != 4:
        raise InputError(str(path), f"{model.rotors} rotors, and {what} knows quadrotors only",
                         "diagnose, without --normal, takes vehicles of three to eight")
    if model.vehicle.input == "thrust":
        raise InputError(str(path), f"input is thrust in N, and {what} gives PWM", "add thrust_voltage or thrust_pwm")
    return model


def loads(text: str, place: str = "simulator.toml") -> Model:
    """A model from the text of a simulator.toml; ``place`` names it in messages."""
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        stated = re.search(r"\(at line (\d+)", str(error))
        number = stated[1] if stated else text.count("\n") + 1  # "at end of document"
        raise InputError(f"{place}: line {number}", f"no TOML: {str(error).partition(' (at')[0]}",
                         "mend the line") from None
    lines = _Lines(text)
    problems = [(lines.of(where), where, found, advice) for where, found, advice in _problems(document)]
    if problems:
        line, where, found, advice = min(problems, key=lambda problem: (problem[1][1] is None, problem[0]))
        key = where[1] or where[0]
        raise InputError(f"{place}: line {line}" + (f", key {key}" if isinstance(key, str) else ""), found, advice)
    vehicle = Vehicle(**document["vehicle"])
    return Model(vehicle, {entry["name"]: {k: v for k, v in entry.items() if k != "name"}
                           for entry in document.get("terms", [])})


def _problems(document: Mapping[str, Any]) -> list[rules.Problem]:
    """All that is wrong, in places (table, key) where table is "", "vehicle" or the number of a term."""
    found = [rules.Problem(("", key), f"unknown key {key}", rules.nearest(key, ["schema", "vehicle", "terms"]))
             for key in document if key not in ("schema", "vehicle", "terms")]
    if document.get("schema") != SCHEMA:
        what = f"schema is {document['schema']!r}" if "schema" in document else "schema is missing"
        found.append(rules.Problem(("", "schema" if "schema" in document else None), what, f'give "{SCHEMA}"'))
    vehicle, terms = document.get("vehicle"), document.get("terms", [])
    if not isinstance(vehicle, dict):
        return [*found, rules.Problem(("", "vehicle"), "there is no table [vehicle]", "give one with mass_kg ...")]
    if not isinstance(terms, list) or not all(isinstance(entry, dict) for entry in terms):
        return [*found, rules.Problem(("", "terms"), "terms is no list of tables", "write [[terms]] before each")]
    defaults = asdict(Vehicle())
    found += rules.vehicle_problems({**{key: defaults[key] for key in MAY_BE_MISSING}, **vehicle})
    known, given = registry.names("terms"), []
    rotors = rules.rotors_of(vehicle) or Vehicle().rotors
    for number, entry in enumerate(terms):
        name = entry.get("name")
        if not isinstance(name, str):
            what, advice = ("name is missing" if name is None else "name is no text"), "give the name of an effect"
            found.append(rules.Problem((number, "name" if "name" in entry else None), what, advice))
        elif name not in known:
            found.append(rules.Problem((number, "name"), f"unknown term {name!r}", rules.nearest(name, known)))
        else:
            values = {key: value for key, value in entry.items() if key != "name"}
            found += rules.term_problems(number, find_term(name), values, rotors)
            given.append((number, find_term(name), values))
    if not found:  # relations between terms only matter once each term is valid
        kind = vehicle.get("input", defaults["input"])
        found += rules.model_problems(kind, [(term, values) for _, term, values in given])
    return found


class _Lines:
    """Line in which a table begins and a key is set."""

    def __init__(self, text: str) -> None:
        self.lines: dict[tuple[Any, Any], int] = {}
        table: Any = ""
        terms = -1
        for number, line in enumerate(text.splitlines(), start=1):
            if header := _HEADER.match(line):
                name = header[2].strip("\"' ")
                terms += int(name == "terms")
                table = terms if name == "terms" else name
                self.lines.setdefault((table, None), number)
                self.lines.setdefault(("", name), number)
            elif key := _KEY.match(line):
                parts = [part.strip("\"' ") for part in key[1].split(".")]
                self.lines.setdefault((table, parts[0]), number)
                if table == "" and len(parts) > 1:
                    self.lines.setdefault((parts[0], parts[1]), number)

    def of(self, where: tuple[Any, Any]) -> int:
        """The key's own line, else that of its table, else the first."""
        table, key = where
        for place in ((table, key), (table, None), ("", table if isinstance(table, str) else "terms")):
            if place in self.lines:
                return self.lines[place]
        return 1


def dumps(model: Model, remarks: Mapping[str, str] = MappingProxyType({})) -> str:
    """Text of a simulator.toml that ``loads`` turns into an equal model; every line says its unit.

    remarks: by parameter (``thrust_scale.s``), written behind the unit.

    Raises InputError for a model whose values have left their physical bounds.
    """
    try:
        import tomlkit
    except ImportError:
        raise MissingExtraError("tomlkit", "identification") from None
    model.check()
    document = tomlkit.document()
    document["schema"] = SCHEMA
    vehicle = tomlkit.table()
    for key, value in asdict(model.vehicle).items():
        vehicle[key] = _lists(value)
        vehicle[key].comment(UNITS[key])
    document["vehicle"] = vehicle
    terms = tomlkit.aot()
    for term in model.terms:
        table = tomlkit.table()
        table["name"] = term.name
        table["name"].comment(term.equation)
        for name, value in model.values_of(term.name).items():
            table[name] = _lists(value)
            remark = remarks.get(f"{term.name}.{name}", "")
            table[name].comment(term.parameter(name).unit + f"; {remark}" * bool(remark))
        terms.append(table)
    document["terms"] = terms
    return tomlkit.dumps(document)


def _lists(value: Any) -> Any:
    return [_lists(v) for v in value] if isinstance(value, tuple) else value


def write_simulator(model: Model, path: Path | str, remarks: Mapping[str, str] = MappingProxyType({})) -> None:
    """Write ``dumps`` to a file, whole or not at all."""
    write_bytes(Path(path), dumps(model, remarks).encode("utf-8"))
