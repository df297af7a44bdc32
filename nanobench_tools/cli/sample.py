"""``nanobench sample``: the three SYNTHETIC flights of the package, as files."""

import shutil
from pathlib import Path

import click

from ..errors import InputError
from ..practice.sample_files import sample_files
from ..steps.options import Options
from .closing import close
from .shared_options import shared_options


@click.command()
@shared_options("data", "jobs", "scheduler", "seed", "clock", "columns")
def sample(options: Options) -> int:
    """Write the three short SYNTHETIC flights that come with the package into ./sample (or --out DIR).

    A circle without faults, a trefoil whose radio log stops in the air, and a multisine whose timestamps wander.
    Files of the same name are overwritten. In Python: nb.sample().
    """
    folder = options.out or Path("sample")
    written = []
    for file in sample_files():
        try:
            folder.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, folder / file.name)
        except OSError as error:
            raise InputError(str(folder / file.name), f"cannot be written ({error.strerror})",
                             "give another place") from None
        written.append(str(folder / file.name))
    options.out = None
    close(options, f"{len(written) // 2} SYNTHETIC recordings written to {folder}", "find their faults",
          "nanobench", "audit", str(folder))
    return options.finish("sample", {"files": written})
