"""A small folder of practice recordings and the command line in process."""

import pytest

from identification.greybox import ablation_study
from nanobench_tools.cli.main import main
from nanobench_tools.practice.logging_chain import LoggingChain
from nanobench_tools.sources.nanobench_writer import write_nanobench


@pytest.fixture(scope="session")
def recordings(tmp_path_factory, crowd):
    """Folder with three short practice recordings (circle, trefoil, helix; SYNTHETIC)."""
    folder = tmp_path_factory.mktemp("recordings")
    for name in ("short circle", "short trefoil", "short helix"):
        flight = crowd.flight(name)
        write_nanobench(flight, folder / f"{flight.name}.csv")
    return folder


@pytest.fixture(scope="session")
def wandering(tmp_path_factory, crowd):
    """Folder with two practice recordings (SYNTHETIC) whose clock is 40 ms late and wanders by 30 ms."""
    folder = tmp_path_factory.mktemp("wandering")
    for name in ("slow figure_eight", "slow trefoil"):
        flight = crowd.flight(name, LoggingChain(wander_sd_s=0.03, offset_s=0.04))
        write_nanobench(flight, folder / f"{flight.name}.csv")
    return folder


@pytest.fixture
def one_fit(monkeypatch):
    """Of the models that are fitted when nothing else is asked for only the quickest: each takes seconds."""
    monkeypatch.setattr(ablation_study, "SHORT", ablation_study.SHORT[:1])


@pytest.fixture
def nanobench(capsys):
    """``nanobench("audit", "--data", folder)`` -> (exit code, stdout, stderr)."""
    def call(*arguments):
        code = main([str(a) for a in arguments])
        out = capsys.readouterr()
        return code, out.out, out.err

    return call
