"""One self-contained page, CSV and LaTeX from the JSON results."""

from .report_page import write_report
from .tables import write_tables

__all__ = ["write_report", "write_tables"]
