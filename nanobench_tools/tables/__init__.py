"""One kind of table, and how it is shown: terminal, page, spreadsheet, LaTeX, pandas."""
