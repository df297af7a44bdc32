"""Results: frozen dataclasses, their files and tables, the cache folder."""
