"""One piece of work, and doing it once: what every way of running shares."""

import os
import traceback
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_type_hints

from ..errors import NanobenchError
from ..results.result import from_json
from .identity import item_key
from .store import Store, encode
from .threads import one_thread


@dataclass(frozen=True)
class Item:
    """One piece of work: a module-level ``function`` that turns ``kwargs`` into what ``to_json`` takes, an object.

    key: ``item_key``; label: what a person calls it; file: the input it is about (found in ``kwargs`` if empty).
    """

    key: str
    function: Callable[..., Any]
    kwargs: Mapping[str, Any]
    label: str
    file: str = ""

    def read(self, value: dict[str, Any]) -> Any:
        """What the function gave (a dataclass, if it says that it returns one) from its JSON ``value``."""
        try:
            return from_json(get_type_hints(self.function).get("return"), value)
        except NameError:  # names that only a type checker imports are of no result
            return value


@dataclass(frozen=True)
class Outcome:
    """What came of one item: a value as JSON, or one line of error."""

    value: dict[str, Any] | None = None
    error: str | None = None


Results = Generator[tuple[Item, Outcome]]


def make_item(function: Callable[..., Any], kwargs: Mapping[str, Any], label: str,
              inputs: Sequence[str] = (), file: str = "") -> Item:
    """An Item with its key. ``inputs``: content hashes of the files that ``kwargs`` only names."""
    return Item(item_key(function, kwargs, inputs), function, kwargs, label, file)


def execute(item: Item, store: Store | None) -> Outcome:
    """Does one item, here, and stores its value at once."""
    try:
        with one_thread():
            value = encode(item.function(**item.kwargs))
        if store is not None:
            store.put(item.key, value, item.label)
        return Outcome(value=value)
    except NanobenchError as error:
        return Outcome(error=str(error))
    except (Exception, SystemExit) as error:  # a method is anybody's code: how it ends concerns this item alone
        if os.environ.get("NANOBENCH_DEBUG"):
            traceback.print_exc()
        return Outcome(error=describe(error))


def describe(error: BaseException) -> str:
    """Type, message and place of an exception on one line."""
    frames = traceback.extract_tb(error.__traceback__)
    where = f" (in {frames[-1].name}, {Path(frames[-1].filename).name}:{frames[-1].lineno})" if frames else ""
    return " ".join(f"{type(error).__name__}: {error}".split()) + where
