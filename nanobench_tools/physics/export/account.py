"""Account of a model in another simulator: kept, approximated and lost effects, and assumptions."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from ..model import Model


@dataclass(frozen=True)
class Account:
    """{term: sentence}. ``exact``: the same equation. ``commands``: it acts on the commands, before the simulator, and
    is written next to its parameters. ``approximated``: equal at one point only. ``left_out``: no counterpart.
    ``assumed``: {quantity: sentence} of numbers the model does not contain."""

    exact: dict[str, str] = field(default_factory=dict)
    commands: dict[str, str] = field(default_factory=dict)
    approximated: dict[str, str] = field(default_factory=dict)
    left_out: dict[str, str] = field(default_factory=dict)
    assumed: dict[str, str] = field(default_factory=dict)

    def lines(self) -> list[str]:
        """For a comment: one line for everything that is not simply the same."""
        heads = (("approximated", self.approximated), ("LEFT OUT", self.left_out), ("assumed", self.assumed))
        return [f"{head}: {name}: {text}" for head, found in heads for name, text in found.items()]


@dataclass(frozen=True)
class Exported:
    """Files written for one simulator, and what they can express."""

    files: tuple[Path, ...]
    account: Account


def account(model: Model, simulator: str, exact: Mapping[str, str], approximated: Mapping[str, str],
            assumed: Mapping[str, str]) -> Account:
    """Sorts the terms of a model by what ``simulator`` makes of them; a term that nobody names is left out."""
    made = Account(assumed=dict(assumed))
    for term in model.terms:
        name = term.name
        if term.on_commands:
            made.commands[name] = term.equation
        elif name in exact:
            made.exact[name] = exact[name] or term.equation
        elif name in approximated:
            made.approximated[name] = approximated[name]
        else:
            made.left_out[name] = term.left_out.get(simulator) or term.left_out.get("") or \
                f"{simulator} has nothing like {term.equation}"
    return made
