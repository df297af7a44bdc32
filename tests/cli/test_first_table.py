"""A screen that is too short shows all recordings before details of the first ones."""

import pytest

from nanobench_tools.cli.closing import _show_within
from nanobench_tools.tables.result_table import Table


class Screen:
    """Keeps what is shown, with the lines that a table may have."""

    def __init__(self) -> None:
        self.shown = []

    def show(self, part, most=None):
        self.shown.append((part if isinstance(part, str) else part.title, most))


@pytest.mark.parametrize(("first", "shown"), [
    (True, [("all", None), ("one", 7), ("... 1 more table: --verbose", None)]),
    (False, [("all", 5), ("one", 5), ("two", 6)]),
])
def test_the_first_table_keeps_its_rows(first, shown):
    tables = [Table.plain(title, ("name", "words"), [(f"n{k}", "w") for k in range(rows)])
              for title, rows in (("all", 5), ("one", 5), ("two", 5))]
    screen = Screen()
    _show_within(screen, tables, 16, first)
    assert screen.shown == shown


def test_a_first_table_longer_than_the_screen_is_cut_alone():
    tables = [Table.plain(title, ("name", "words"), [(f"n{k}", "w") for k in range(50)]) for title in ("all", "one")]
    screen = Screen()
    _show_within(screen, tables, 16, True)
    assert screen.shown == [("all", 15), ("... 1 more table: --verbose", None)]
