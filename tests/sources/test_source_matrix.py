"""docs/sources.md is what its command writes, and sources hold what it says."""

from __future__ import annotations

import pytest
from asl_samples import members, write_folder
from foreign_files import FOREIGN
from test_ardupilot import log as ardupilot
from test_blackbox import log as blackbox
from test_cfclient import blocks as client_blocks
from test_cfclient import write as write_blocks
from test_idsia import columns, text
from test_insane import tables
from test_insane import write as write_insane
from test_neurobem_and_neural_fly import neural_fly, neurobem, table
from test_usd_blocks import log
from test_uzhfpv import write

from nanobench_tools.flight import kept_apart
from nanobench_tools.lookup.registry import names
from nanobench_tools.sources import load_recordings
from nanobench_tools.sources.contents import CONTENTS
from tools.source_matrix import PAGE, cell, flight_of, page


def file_of(source, folder):
    if source == "euroc":
        return write_folder(folder, members())
    if source == "cfclient":
        return write_blocks(folder / "flight", client_blocks())
    if source == "insane":
        return write_insane(folder / "flight", tables())
    if source == "uzhfpv":
        return write(folder / "flight")
    header, blocks = log()
    data = {"idsia": text(columns()), "usd_blocks": header + b"".join(blocks),
            "tum": FOREIGN["TUM of rpg"].data, "neurobem": table(neurobem()), "neural_fly": neural_fly(),
            "blackbox": blackbox(), "ardupilot": b"".join(ardupilot(poses=False))}.get(source)
    if data is None:
        import test_hdf5 as hdf5

        data = hdf5.file(**getattr(hdf5, source)())
    (folder / "a").write_bytes(data)
    return folder / "a"


@pytest.mark.parametrize("source", ["euroc", "uzhfpv", "idsia", "usd_blocks", "tum", "dido", "blackbird", "neurobem",
                                    "neural_fly", "insane", "blackbox", "ardupilot", "cfclient"])
def test_contents_are_those_of_a_file_of_the_source(source, tmp_path):
    (flight,) = load_recordings([file_of(source, tmp_path)], cache=False).flights
    assert flight.provenance.source == source
    assert {n: set(s.quantities) for n, s in flight.streams.items() if not kept_apart(n)} == {
        n: set(quantities) for n, quantities in CONTENTS[source].items()}


def test_the_page_is_what_the_command_writes():
    assert PAGE.read_text(encoding="utf-8") == page()


def test_every_source_of_this_package_has_a_row():
    ours = {name for name in names("sources") if name not in ("foreign", "example")}
    assert set(CONTENTS) <= ours


def test_cells_say_what_is_missing():
    assert cell("estimate", flight_of(CONTENTS["euroc"])) == "works"
    assert cell("estimate", flight_of(CONTENTS["tum"])) == "in part: only --trajectory-dir (no imu stream)"
    assert cell("sysid", flight_of(CONTENTS["euroc"])) == "no: no motor stream"
