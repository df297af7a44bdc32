"""Controllers: one file per row of Task 2."""
