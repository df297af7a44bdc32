# %% [markdown]
# # 2. Compare an estimator with the onboard EKF
#
# The onboard EKF of the vehicle estimated its pose in flight. Is another estimator better? In the protocol `aided`, an
# estimator gets ten noisy poses a second, 30 ms late, and every other stream whole. The flights are SYNTHETIC.

# %%
import nanobench_tools as nb

flights = nb.sample()
found = nb.estimate(flights, ["onboard_ekf", "drag_ekf", "hold_position"])
print(found.metrics[["n", "ate_rmse_m", "velocity_rmse_m_s", "attitude_rmse_deg"]].round(4))

# %% [markdown]
# The methods did not get the same: the onboard EKF had every pose in flight. `given` reports this for each method.

# %%
# alt: Path of the circle from above: motion capture and three estimates, which lie on top of each other at this scale.
found.plot()

# %% [markdown]
# A comparison needs the ratio of the errors on the same flights. A method is better where the whole interval is below
# one. With three flights the interval is too narrow to trust, and `ci_why` says so.

# %%
table = nb.compare(flights, ["hold_position", "drag_ekf"])
row = table[table["metric"] == "ate_rmse_m"]
print(row[["method", "mean", "ratio", "ratio_low", "ratio_high", "n", "ci_why"]].round(3).to_string(index=False))

# %% [markdown]
# A part of the onboard EKF's error is the error of its timestamps. Re-timing removes that part; it never uses the
# position that is judged.

# %%
for clock in ("as-recorded", "retimed"):
    ate = nb.estimate(flights["sample_multisine_sysid"], "onboard_ekf", protocol="clean", clock=clock)
    print(f"{clock}: ATE {1000 * ate.metrics.loc['onboard_ekf', 'ate_rmse_m']:.1f} mm")

# %% [markdown]
# Your own estimator is an object in the list: `nb.estimate(flights, [MyEstimator(), "drag_ekf"])`.
# [Add an estimator](../howto/add_an_estimator.md) shows how to write one.
