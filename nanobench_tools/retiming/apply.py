"""Former place of ``nanobench_tools.time_offsets.moving.apply``."""

from ..deprecation import renamed

__getattr__ = renamed(__name__, {"retimed": "nanobench_tools.time_offsets.moving.apply:retimed"})
