"""Make the three SYNTHETIC flights of the package: ``python -m tools.sample_flights``.

One nominal vehicle flies a circle, a trefoil and a multisine for system identification. The circle is clean. The radio
log of the trefoil stops in the air, and the vehicle's timestamps of the multisine wander: two faults that real
recordings have. Values have eight digits, which keeps the interpolated rows on their straight lines.
"""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from nanobench_tools.practice.flights import practice_flights
from nanobench_tools.practice.inject import INJECTIONS
from nanobench_tools.practice.logging_chain import LoggingChain
from nanobench_tools.sources.nanobench import write_nanobench

OUT = Path(__file__).resolve().parents[1] / "nanobench_tools/sample"
SEED = 7
SECONDS = 6.0
"""Length of the path; take-off and landing add twelve seconds."""
DEAD_S = 5.0
"""Before its end the trefoil's log stops: two seconds before the landing."""
WANDER_S = 0.02
"""Standard deviation of the multisine's timestamps; the public recordings have about 0.033 s."""
DIGITS = 8


def main(out: Path = OUT) -> list[Path]:
    """Write the flights into a folder; their paths."""
    out.mkdir(parents=True, exist_ok=True)
    written = []
    for index, family in enumerate(("circle", "trefoil", "multisine_sysid")):
        chain = LoggingChain(wander_sd_s=WANDER_S if family == "multisine_sysid" else 0.0)
        flight = practice_flights(1, SEED + index, families=(family,), spread=0.0, duration_s=SECONDS,
                                  speeds=("medium",), controllers=("pid",), chain=chain)[0]
        if family == "trefoil":
            flight, _ = INJECTIONS["dead_stream"].function(flight, np.random.default_rng(SEED), DEAD_S)
        name = f"sample_{family}"
        with tempfile.TemporaryDirectory() as folder:
            plain = write_nanobench(replace(flight, name=name), Path(folder) / f"{name}.csv")
            table = pd.read_csv(plain, dtype=str, keep_default_na=False)
            for column in table.columns.drop("t"):
                table[column] = [cell and format(float(cell), f".{DIGITS}g") for cell in table[column]]
            path = out / f"{name}.csv.xz"
            table.to_csv(path, index=False, compression={"method": "xz", "preset": 9})
            for sheet in Path(folder).glob("*.yaml"):
                (out / sheet.name).write_bytes(sheet.read_bytes())
        print(f"{path.name}: {path.stat().st_size / 1000:.0f} kB, {flight.duration_s:.1f} s")
        written.append(path)
    return written


if __name__ == "__main__":
    main()
