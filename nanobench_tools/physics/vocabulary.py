"""All registered terms, and which of them a question concerns: nobody keeps a list of names."""

import functools
from collections.abc import Callable

from ..lookup import registry
from .term import Term


@functools.cache
def vocabulary() -> dict[str, Term]:
    """{name: term} of all registered terms, sorted; a plug-in that cannot be loaded is left out with a warning."""
    return {name: term for name, term in sorted(registry.load_all("terms").items()) if isinstance(term, Term)}


def added() -> dict[str, Term]:
    """Those of other packages."""
    theirs = registry.added("terms")
    return {name: term for name, term in vocabulary().items() if name in theirs}


def terms_that(are: Callable[[Term], bool]) -> tuple[str, ...]:
    """Names of the registered terms of which ``are`` holds, sorted."""
    return tuple(name for name, term in vocabulary().items() if are(term))
