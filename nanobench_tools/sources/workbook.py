"""Workbooks (.xlsx): the one sheet with cells, as the text of a table. openpyxl, an optional package, reads them."""

from __future__ import annotations

import csv
import datetime
import io
import zipfile
from pathlib import Path
from typing import Any, BinaryIO

from ..errors import InputError, how_to_install

PART = "xl/workbook.xml"
EXTRA = "excel"


def is_workbook(file: Path | BinaryIO) -> bool:
    """Whether a file is a workbook, of which only the list of parts is read; False for other and damaged archives."""
    try:
        with zipfile.ZipFile(file) as archive:
            return PART in archive.namelist()
    except (zipfile.BadZipFile, OSError, ValueError):
        return False


def table_of(stored: bytes, place: str) -> bytes:
    """The only sheet with cells as CSV in UTF-8. InputError without openpyxl, and for none or several such sheets."""
    try:
        import openpyxl
    except ImportError:
        raise InputError(place, "a workbook is read through openpyxl",
                         f"{how_to_install(EXTRA)}; or save its sheet as CSV") from None
    try:
        book = openpyxl.load_workbook(io.BytesIO(stored), read_only=True, data_only=True)
        sheets = {sheet.title: [row for row in sheet.iter_rows(values_only=True) if any(c is not None for c in row)]
                  for sheet in book.worksheets}
    except Exception as error:  # a damaged workbook raises errors of many packages
        raise InputError(place, f"the workbook is damaged ({str(error)[:80]})", "save its sheet as CSV") from None
    filled = {title: rows for title, rows in sheets.items() if rows}
    if len(filled) != 1:
        raise InputError(place, f"a workbook with {len(filled)} sheets that have cells"
                         + f" ({', '.join(filled)})" * bool(filled), "save the sheet of the recording as CSV")
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([_cell(c) for c in row] for row in next(iter(filled.values())))
    return text.getvalue().encode()


def _cell(cell: Any) -> Any:
    return cell.isoformat() if isinstance(cell, datetime.datetime) else "" if cell is None else cell
