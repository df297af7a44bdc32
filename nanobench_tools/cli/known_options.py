"""Options for what the user knows about flights that are compared with normal ones."""

import functools
from collections.abc import Callable

import click

from identification.mismatch.steady.known import Known

KNOWN = {
    "same_day": "were flown on the same day, with the same motors and propellers. Smaller changes are then detected "
                "(from one day to another a motor may move by 10 %).",
    "nothing_added": "have nothing put onto the vehicle or hung from it that the normal ones lack.",
    "same_vehicle": "are of the same vehicle. Otherwise motors that all changed may mean another one."}


def knows(where: str) -> Callable[[Callable[..., int]], Callable[..., int]]:
    """Adds the options of ``Known`` to a verb, which gets them as ``known``. ``where``: the option they go with."""
    def decorate(verb: Callable[..., int]) -> Callable[..., int]:
        @functools.wraps(verb)
        def called(*args: object, **given: object) -> int:
            return verb(*args, known=Known(**{name: bool(given.pop(name)) for name in KNOWN}), **given)

        for name, text in reversed(KNOWN.items()):
            called = click.option(f"--{name.replace('_', '-')}", is_flag=True,
                                  help=f"With {where}: these flights {text}")(called)
        return called
    return decorate
