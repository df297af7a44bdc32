"""Every file of the product has a name of its own, so that a concept is found by its word."""

from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).parents[1]
OURS = ("nanobench_tools", "estimators", "controllers", "identification")
MIRRORED = ("nanobench_tools/physics/terms", "identification/mismatch/steady/causes")
"""One physical effect has a file of the same name here: its equation, and what it does to a trim."""

FORMER = ("nanobench_tools/faults", "nanobench_tools/retiming")
"""Places of the last release that only name today's (``renamed``)."""


def names() -> dict[str, list[str]]:
    found = defaultdict(list)
    for top in OURS:
        for path in (ROOT / top).rglob("*.py"):
            folder = path.relative_to(ROOT).parent.as_posix()
            if path.stem != "__init__" and folder not in FORMER:
                found[path.stem].append(folder)
    return found


def twice() -> set[str]:
    return {name for name, folders in names().items() if len(folders) > 1 and not set(folders) <= set(MIRRORED)}


def test_a_file_has_a_word_of_its_own():
    assert len(names()) > 400
    assert twice() == set()


def test_every_folder_of_modules_is_a_package():
    """A folder without ``__init__.py`` works in a checkout and is missing in a built distribution."""
    folders = {path.parent for package in OURS for path in (ROOT / package).rglob("*.py")}
    assert len(folders) > 30
    assert [str(folder.relative_to(ROOT)) for folder in folders if not (folder / "__init__.py").is_file()] == []
