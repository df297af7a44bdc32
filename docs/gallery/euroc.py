# %% [markdown]
# # A folder in the layout of EuRoC
#
# Data sets such as EuRoC MAV and TUM-VI are folders with a table for each sensor. A SYNTHETIC flight is written in this
# layout and read back, and an estimator is scored on it. The layout has no place for the word SYNTHETIC, so the table
# below says REAL. No motor is logged there, so control and identification are
# not possible; see [which verb uses which source](../sources.md).

# %%
from pathlib import Path

import numpy as np

import nanobench_tools as nb

flight = nb.sample()["sample_circle"]
poses, imu = flight["mocap"], flight["imu"]


def table(folder: str, head: str, time_s: np.ndarray, values: np.ndarray) -> None:
    path = Path("mine/mav0") / folder
    path.mkdir(parents=True)
    rows = [",".join([str(round(1e9 * (flight.epoch_s + t))), *(f"{v:.8f}" for v in row)])
            for t, row in zip(time_s, values, strict=True)]
    (path / "data.csv").write_text("\n".join([f"#timestamp [ns],{head}", *rows]))


table("imu0", "w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
      "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]",
      imu.time_s, imu["gyro_x", "gyro_y", "gyro_z", "acc_x", "acc_y", "acc_z"])
table("vicon0", "p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z []",
      poses.time_s, poses["px", "py", "pz", "qw", "qx", "qy", "qz"])

again = nb.load("mine")
print(again)
found = nb.estimate(again, ["error_state_ekf", "hold_position"])
print((1000 * found.metrics["ate_rmse_m"]).round(1).rename("ATE, mm"))

# %%
# alt: The path from above: motion capture and the estimates of two methods.
found.plot()
