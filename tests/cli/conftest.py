"""A small folder of practice recordings and the command line in process."""

from __future__ import annotations

import pytest

from identification.greybox import study
from nanobench_tools.cli.main import main
from nanobench_tools.practice.flights import practice_flights
from nanobench_tools.practice.logging_chain import LoggingChain
from nanobench_tools.sources.nanobench_writer import write_nanobench


@pytest.fixture(scope="session")
def recordings(tmp_path_factory):
    """Folder with three short practice recordings (circle, trefoil, helix; SYNTHETIC)."""
    folder = tmp_path_factory.mktemp("recordings")
    for flight in practice_flights(3, seed=5, families=("circle", "trefoil", "helix"), duration_s=6.0):
        write_nanobench(flight, folder / f"{flight.name}.csv")
    return folder


@pytest.fixture(scope="session")
def wandering(tmp_path_factory):
    """Folder with two practice recordings (SYNTHETIC) whose clock is 40 ms late and wanders by 30 ms."""
    folder = tmp_path_factory.mktemp("wandering")
    chain = LoggingChain(wander_sd_s=0.03, offset_s=0.04)
    for flight in practice_flights(2, seed=21, families=("figure_eight", "trefoil"), duration_s=16.0, chain=chain):
        write_nanobench(flight, folder / f"{flight.name}.csv")
    return folder


@pytest.fixture(autouse=True)
def own_cache(tmp_path_factory, monkeypatch):
    """Nothing is read from or left in the cache of the user."""
    monkeypatch.setenv("NANOBENCH_CACHE", str(tmp_path_factory.getbasetemp() / "cache"))


@pytest.fixture
def one_fit(monkeypatch):
    """Of the models that are fitted when nothing else is asked for only the quickest: each takes seconds."""
    monkeypatch.setattr(study, "SHORT", study.SHORT[:1])


@pytest.fixture
def nanobench(capsys):
    """``nanobench("audit", "--data", folder)`` -> (exit code, stdout, stderr)."""
    def call(*arguments):
        code = main([str(a) for a in arguments])
        out = capsys.readouterr()
        return code, out.out, out.err

    return call
