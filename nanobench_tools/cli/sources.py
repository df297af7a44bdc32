"""``nanobench sources``: the formats that are read, and what each is good for."""

import inspect
import tomllib
from importlib import resources

import click

from ..steps.options import Options, one_line
from ..tables.result_table import Table
from .closing import close
from .shared_options import shared_options

GOOD_FOR: dict[str, tuple[str, str]] = {
    "nanobench": ("NanoBench CSV with its sheet", "every verb"),
    "table": ("your own CSV or Parquet", "first: nanobench columns FILE"),
    "usd": ("Crazyflie uSD log", "audit, thrust, motors; more: --mocap"),
    "cfclient": ("cfclient log, CSV", "audit; more: --mocap"),
    "ulog": ("PX4 log (.ulg)", "audit, thrust; more if it has mocap"),
    "ardupilot": ("ArduPilot log (.bin)", "audit, thrust, motors"),
    "blackbox": ("Betaflight, INAV: CSV", "audit, thrust; .bbl: blackbox_decode"),
    "rosbag": ("ROS 1 and 2 bag", "audit, estimate; motors: --columns"),
    "tum": ("TUM trajectory", "truth or estimate: --trajectory-dir"),
    "kitti": ("KITTI poses with times.txt", "truth"),
    "mocap_export": ("Motive, Vicon, Qualisys", "truth: --trajectory-dir"),
    "npy_mocap": ("Bitcraze .npy: ms, x, y, z", "truth: convert LOG --mocap FILE"),
    "stand": ("thrust-stand table", "thrust"),
    "euroc": ("EuRoC, TUM-VI (ASL layout)", "audit, estimate, noise"),
    "uzhfpv": ("UZH-FPV text", "audit, estimate, noise"),
    "idsia": ("IDSIA nano-quadrotor", "audit"),
    "usd_blocks": ("first uSD log (Crazyswarm)", "audit"),
    "dido": ("DIDO, HDF5", "audit, estimate, noise"),
    "blackbird": ("Blackbird, HDF5", "audit, estimate, noise"),
    "insane": ("INSANE, CSV of its sensors", "audit, estimate, noise"),
    "neurobem": ("NeuroBEM, CSV", "audit"),
    "neural_fly": ("Neural-Fly, CSV", "audit"),
}
"""Source -> (what it is, what its recordings are good for)."""
DATASET_KEYS = ("name", "read", "licence", "size", "get", "use")


@click.command()
@shared_options("data", "jobs", "scheduler", "seed", "clock", "columns")
def sources(options: Options) -> int:
    """The formats of recordings that are read, and what each is good for; those of other packages, too.

    A file is recognised by its content, not by its name. Option --verbose also lists public data sets with licence,
    size, where to get them, and what each is good for. Nothing is downloaded.
    """
    from ..lookup.registry import load_all
    from ..sources.discover import default_data

    found = dict(GOOD_FOR)
    for name, kind in load_all("sources").items():
        if name not in found:
            found[name] = (((inspect.getdoc(kind) or "").splitlines() or [""])[0], "see its package")
    table = Table.plain("", ("source", "format", "good for"), [
        (one_line(name), one_line(what), one_line(use)) for name, (what, use) in found.items()])
    known = datasets()
    listed = Table.plain("Public data sets", ("data set", "read by", "licence", "size", "get it", "good for"), [
        tuple(one_line(entry[key]) or "-" for key in DATASET_KEYS) for entry in known])
    then = ("what is in yours", "nanobench", "audit") if default_data() else (
        "recordings to try", "nanobench", "simulate", "--flights", "3", "--out", "practice")
    close(options, f"{len(found)} formats, {len(known)} public data sets (--verbose)", *then, screen=[table],
          detail=[table, listed])
    return options.finish("sources", {"sources": [{"source": name, "format": what, "good_for": use}
                                                  for name, (what, use) in found.items()],
                                      "datasets": known})


def datasets() -> list[dict[str, str]]:
    """Public data sets: name, read (sources that open its files), licence, size, get, use.

    A value that the inspected files do not state is "unknown".
    """
    text = resources.files("nanobench_tools.sources").joinpath("datasets.toml").read_text(encoding="utf-8")
    return [{key: str(entry[key]) for key in DATASET_KEYS} for entry in tomllib.loads(text)["dataset"]]
