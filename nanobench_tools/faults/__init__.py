"""Former place of ``nanobench_tools.auditing.faults``."""
