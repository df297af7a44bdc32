"""One file per physical effect; each holds TERM, registered under ``nanobench.terms``."""
