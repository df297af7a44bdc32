"""What every template of a page may use."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..errors import how_to_install

if TYPE_CHECKING:
    from jinja2 import Environment


def environment(**more: Any) -> Environment:
    """The templates, which escape what they are given and refuse what they were not given; ``more``: known names in
    addition to ``how_to_install``."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    made = Environment(loader=PackageLoader("nanobench_tools.pages"), autoescape=True, trim_blocks=True,
                       lstrip_blocks=True, undefined=StrictUndefined)
    made.globals.update(how_to_install=how_to_install, **more)
    return made
