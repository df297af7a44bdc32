"""Former place of ``nanobench_tools.time_offsets.moving``."""
