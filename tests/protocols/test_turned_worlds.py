"""A trajectory in another world is scored as in that of the motion capture: no error depends on the frame."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from nanobench_tools.flight import Span
from nanobench_tools.protocols.task3 import Case, score
from nanobench_tools.sources.trajectory_file import TrajectoryFile


@pytest.fixture(scope="module")
def case(crowd):
    flight = crowd.log("trefoil")[0]
    return Case(flight, (Span(4.0, 11.0),), ("all",))


def scored(case, folder, world, shift=(0.0, 0.0, 0.0)):
    mocap = case.flight["mocap"]
    keep = np.isfinite(mocap.values).all(axis=1)
    t = (mocap.time_s + case.flight.epoch_s)[keep]
    p, q = mocap["px", "py", "pz"][keep], mocap["qx", "qy", "qz", "qw"][keep]
    p = world.apply(p + 0.01 * np.random.default_rng(0).standard_normal(p.shape)) + shift
    folder.mkdir()
    np.savetxt(folder / f"{case.flight.name}.tum", np.column_stack([t, p, (world * Rotation.from_quat(q)).as_quat()]),
               fmt="%.9f")
    return score(case, TrajectoryFile(folder / f"{case.flight.name}.tum"), "clean").metrics


@pytest.mark.parametrize("turn", [(40.0, 0.0, 0.0), (-90.0, 0.0, 0.0), (180.0, 0.0, 0.0), (25.0, 10.0, -30.0)])
def test_no_error_depends_on_the_world(case, tmp_path, turn):
    plain = scored(case, tmp_path / "same", Rotation.identity())
    turned = scored(case, tmp_path / "other", Rotation.from_euler("zyx", turn, degrees=True), (3.0, -2.0, 0.5))
    assert plain.get("world_turn_deg") is None
    size = np.degrees(Rotation.from_euler("zyx", turn, degrees=True).magnitude())
    assert turned["world_turn_deg"] == pytest.approx(size, abs=1.0)
    assert turned["attitude_geodesic_rmse_deg"] < 1.0
    for name in ("ate_rmse_m", "rte_1m_m", "rte_1m_start_frame_m"):
        assert turned[name] == pytest.approx(plain[name], rel=0.05, abs=1e-4), name
    assert turned["ate_unaligned_rmse_m"] > 1.0


def test_a_wrong_heading_of_two_degrees_is_an_error_of_its_own(case, tmp_path):
    found = scored(case, tmp_path / "same", Rotation.from_euler("z", 2.0, degrees=True))
    assert found["attitude_geodesic_rmse_deg"] == pytest.approx(2.0, abs=0.1)
    assert "world_turn_deg" not in found
