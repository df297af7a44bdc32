"""One self-contained page, CSV and LaTeX from the JSON results."""
