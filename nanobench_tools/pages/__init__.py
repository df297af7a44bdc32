"""One self-contained page, CSV and LaTeX from the JSON results."""

from ..tables.result_table import write_tables
from .report_page import write_report

__all__ = ["write_report", "write_tables"]
