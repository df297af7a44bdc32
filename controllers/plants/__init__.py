"""Plants of Task 2: vehicles that controllers fly, ensembles of them, flights on them, and the one that is served."""
