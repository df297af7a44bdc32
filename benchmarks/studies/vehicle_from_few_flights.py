"""Does the fitted vehicle hover at the logged command, whichever flights it is fitted to?

    python -m benchmarks.studies.vehicle_from_few_flights [DIR ...] [--mass KG] [--arm M] [--draws N]

Each row is one choice of flights: N random draws of 3, of 5 and of 15, every family alone, and all. Columns: PWM that
the fitted vehicle needs over the logged PWM, in hover windows of the flights it was fitted to and of all others. Then
whether a plain controller holds it, inertia about x, drag along y, and the number of parameters that are priors.
"""

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from identification.greybox.fit_windows import cases_of, cut, gather
from identification.greybox.flyability import flies
from identification.vehicle.vehicle_fit import fit_vehicle
from nanobench_tools.auditing.selection import distinct
from nanobench_tools.physics import Vehicle
from nanobench_tools.physics.vehicle import sized
from nanobench_tools.protocols.completed import completed
from nanobench_tools.protocols.task1 import Case
from nanobench_tools.sources.discover import default_data, load_recordings
from nanobench_tools.sources.labels import family_of

SIZES = (3, 5, 15)


def choices(cases: Sequence[Case], draws: int) -> Iterator[tuple[str, list[int]]]:
    """Label of a row, and which of ``cases`` are fitted to."""
    rng = np.random.default_rng(0)
    for size in SIZES:
        for number in range(draws if len(cases) > size else 0):
            yield f"{size} drawn, {number + 1}", rng.choice(len(cases), size, replace=False).tolist()
    families = [family_of(case.flight) or "no family" for case in cases]
    for family in dict.fromkeys(families):
        yield family, [i for i, name in enumerate(families) if name == family]
    yield "all", list(range(len(cases)))


def row(label: str, cases: Sequence[Case], chosen: Sequence[int], vehicle: Vehicle) -> tuple[str, float, float]:
    """Text of a row, and the two ratios (nan: no other flight)."""
    mine, others = [cases[i] for i in chosen], [case for i, case in enumerate(cases) if i not in set(chosen)]
    fitted = fit_vehicle(mine, vehicle)
    own = flies(fitted.model, gather(cut(mine)))
    away = flies(fitted.model, gather(cut(others))).hover_ratio if others else np.nan
    value = fitted.model.parameters
    priors = sum(p.prior_share == 1.0 for p in fitted.parameters.values())
    return (f"{label:<16} {len(mine):>3}  {100 * own.hover_ratio:>7.1f} {100 * away:>7.1f}  "
            f"{'yes' if own.stable else 'NO ':<4} {1e5 * value['inertia.inertia_kg_m2[0]']:>6.2f} "
            f"{1e3 * value['drag_linear.d[1]']:>6.2f} {priors:>4}"), own.hover_ratio, away


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("places", nargs="*", type=Path)
    parser.add_argument("--mass", type=float, default=Vehicle.mass_kg)
    parser.add_argument("--arm", type=float)
    parser.add_argument("--draws", type=int, default=10)
    given = parser.parse_args()
    cases = cases_of(completed(distinct(load_recordings(given.places or default_data() or []).flights)[0]))
    vehicle = sized(given.mass, given.arm)
    print("flights            n   hover %, own and others  held  J_x 1e-5  d_y 1e-3  priors")
    found = []
    for label, chosen in choices(cases, given.draws):
        text, *ratios = row(label, cases, chosen, vehicle)
        found.append(ratios)
        print(text, flush=True)
    off = 100.0 * np.abs(np.array(found) - 1.0)
    print(f"largest difference from the logged command: {off[:, 0].max():.1f} % on the flights fitted to, "
          f"{np.nanmax(off[:, 1]):.1f} % on others")


if __name__ == "__main__":
    main()
