"""``nanobench noise``: how noisy the inertial sensors are, at rest and in flight."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import InputError
from ..steps.options import Options
from ..steps.show import data_word
from .closing import again, close, same
from .shared_options import shared_options

if TYPE_CHECKING:
    from estimators.imu_noise import ImuNoise

FILE = "imu_noise.toml"


@click.command()
@shared_options("clock")
def noise(options: Options) -> int:
    """Noise of gyro and accelerometer, for estimators to reckon with.

    At rest (motors off): overlapping Allan deviation, white noise and bias instability where the rest is long enough.
    In flight: vibration by PWM, power by frequency, and biases of flights. Also how fast the integrals of gyro and
    accelerometer leave the motion capture. --out DIR gets imu_noise.toml, which the smoothers and filters read.
    """
    import numpy as np

    from estimators.imu_noise import ImuNoise, packet_rate_hz

    from ..auditing.selection import distinct
    from ..flight import intersect_spans
    from ..noise.inflight import InFlight
    from ..noise.rest import at_rest

    flights = options.load()
    audits, _ = options.audit(flights)
    kept = [flight for flight in distinct(flights)[0] if flight.name in audits and "imu" in flight]
    rest, flown = at_rest(kept), InFlight()
    for flight in kept:
        audit = audits[flight.name]
        flown.add(flight, intersect_spans(audit.airborne, audit.clean_for(["imu", "mocap"])))
    if rest is None and not flown.flights:
        raise InputError(flights[0].provenance.path, "no recording with accelerometer and gyro stood still or flew")
    gyro, acc, gyro_walk, acc_walk = flown.densities()
    rates = [rate for flight in kept if np.isfinite(rate := packet_rate_hz(flight["imu"]))]
    default = ImuNoise()
    found = {"gyro_rad_s_sqrtHz": gyro, "acc_m_s2_sqrtHz": acc, "gyro_walk_rad_s2_sqrtHz": gyro_walk,
             "acc_walk_m_s3_sqrtHz": acc_walk,
             "gyro_bias_sd_rad_s": float(np.std(flown.gyro_bias)) if len(flown.gyro_bias) > 2 else float("nan"),
             "acc_bias_sd_m_s2": float(np.std(flown.acc_bias)) if len(flown.acc_bias) > 2 else float("nan"),
             "rate_hz": float(np.median(rates)) if rates else float("nan")}
    measured = {name: value for name, value in found.items() if np.isfinite(value) and value > 0.0}
    result = ImuNoise(**{**{name: getattr(default, name) for name in found}, **measured})
    body: dict[str, Any] = {
        "imu": {name: getattr(result, name) for name in found}, "measured": sorted(measured), "flights": flown.flights,
        "rest": None if rest is None else {
            "spans": rest.spans, "seconds": rest.seconds, "tau_s": rest.taus_s.tolist(),
            "acc_allan_m_s2": rest.acc.tolist(), "gyro_allan_rad_s": rest.gyro.tolist(),
            "acc_m_s2_sqrtHz": rest.acc_density.tolist(), "gyro_rad_s_sqrtHz": rest.gyro_density.tolist(),
            "acc_instability_m_s2": rest.acc_instability.tolist(),
            "gyro_instability_rad_s": rest.gyro_instability.tolist()},
        "scatter": [{"over_s": over, "turn_rad": s[0], "vertical_m_s": s[1], "windows": s[2]}
                    for over, s in flown.scatter().items()],
        "gyro_bias_rad_s": [b.tolist() for b in flown.gyro_bias], "acc_bias_z_m_s2": flown.acc_bias,
        "vibration": flown.by_pwm(),
        "spectrum": [{"from_hz": low, "to_hz": high, "acc": float(np.median([p[0] for p in rows])),
                      "gyro": float(np.median([p[1] for p in rows]))} for (low, high), rows in flown.power.items()]}
    _show(options, body)
    body["file"] = _write(options, result, body)
    text = (f"gyro {result.gyro_rad_s_sqrtHz:.2g} rad/s/sqrt(Hz), accelerometer {result.acc_m_s2_sqrtHz:.2g} "
            "m/s²/sqrt(Hz)")
    if body["file"] is None:
        close(options, text, "as a file for estimators", *again("--out", "noise"))
    else:
        close(options, text, "an estimator that reckons with it", "nanobench", "estimate", *same(options), "--protocol",
              "aided", "--method", "error_state_ekf", "--imu-noise", body["file"])
    return options.finish("noise", body)


def _write(options: Options, result: ImuNoise, body: Mapping[str, Any]) -> str | None:
    """imu_noise.toml into ``--out``; its path."""
    from ..results.result_files import write_bytes

    if options.out is None:
        return None
    path = Path(options.out) / FILE
    left = ", ".join(sorted(set(body["imu"]) - set(body["measured"]))) or "none"
    about = (f"{data_word(options)} data, {body['flights']} flights; not measured, so the default: {left}")
    write_bytes(path, result.to_toml(about).encode())
    options.say(f"wrote {path}")
    return str(path)


def _show(options: Options, body: Mapping[str, Any]) -> None:
    rest = body["rest"]
    if rest is None:
        options.say("at rest: nothing stood still with motors off")
    else:
        options.say(f"at rest ({rest['spans']} stretches, {rest['seconds']:.0f} s): gyro x y z "
                    + " ".join(f"{v:.2e}" for v in rest["gyro_rad_s_sqrtHz"]) + " rad/s/sqrt(Hz), accelerometer "
                    + " ".join(f"{v:.2e}" for v in rest["acc_m_s2_sqrtHz"]) + " m/s²/sqrt(Hz)")
    if body["scatter"]:
        imu = body["imu"]
        options.say(f"in flight ({data_word(options)}, {body['flights']} flights): gyro {imu['gyro_rad_s_sqrtHz']:.4f} "
                    f"rad/s/sqrt(Hz), accelerometer, vertical {imu['acc_m_s2_sqrtHz']:.4f} m/s²/sqrt(Hz)")
        for row in body["scatter"]:
            options.say(f"  over {row['over_s']:g} s: turn off by {row['turn_rad']:.4f} rad, vertical velocity by "
                        f"{row['vertical_m_s']:.4f} m/s (SD, {row['windows']} windows)")
    for row in body["vibration"]:
        options.say(f"  PWM {row['pwm']:.3f}: vibration {sum(row['acc_sd_m_s2']) / 3:.3f} m/s², "
                    f"{sum(row['gyro_sd_rad_s']) / 3:.4f} rad/s (mean of axes, {row['windows']} windows)")
