"""The Python functions of ``import nanobench_tools as nb``: flights in, DataFrames, sentences and pictures out.

Each does what the verb of the same name does, by the same functions, without its printing.
"""
