"""``nanobench estimate``: scores of state estimators (Task 3)."""

from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path

import click

from ..errors import UsageError
from ..flight import Flight
from ..pages.task3_tables import task3, task3_attribution, task3_consistency, task3_screen, task3_windows
from ..results.result import to_json
from ..steps.estimate_pictures import attribution
from ..steps.estimating import estimate_body, ranked_by_clock, see, trajectory_files
from ..steps.named_methods import load_methods
from ..steps.options import Options
from ..steps.result_bodies import EstimateBody
from ..steps.sentences import estimated
from ..time_offsets.moving.votes import AS_RECORDED
from .closing import again, close, close_scores
from .shared_options import PATH, FiniteRange, shared_options

WITHOUT_LOG = ("aided", "blackout")
"""Protocols of recordings without an onboard estimate, when none is requested."""


@click.command()
@shared_options()
@click.option("--protocol", "protocols", multiple=True, metavar="NAME",
              help="as-published, as-published-corrected, clean, aided, blackout or whole-flight; may repeat. Default: "
                   "the first three.")
@click.option("--method", "methods", multiple=True, metavar="NAME|module:Class",
              help="Estimator to score as well; may repeat.")
@click.option("--only", is_flag=True, help="Score the estimators of --method alone.")
@click.option("--trajectory-dir", "folders", multiple=True, type=PATH, metavar="DIR",
              help="Score DIR/<flight>.tum at their own timestamps; the method is the folder's name.")
@click.option("--imu-noise", "noise_file", type=PATH, metavar="FILE",
              help="imu_noise.toml of nanobench noise, for the rows of --method that take one (smoothers and filters).")
@click.option("--pose-rate", "rates", multiple=True, type=FiniteRange(min=0.1, max=1000.0), metavar="HZ",
              help="aided: poses per second; may repeat, as may the next three, for every combination. Default: 10.")
@click.option("--pose-delay", "delays", multiple=True, type=FiniteRange(min=0.0, max=10.0), metavar="S",
              help="aided: how long after it was measured a pose arrives. Default: 0.03.")
@click.option("--pose-noise", "noises", multiple=True, type=FiniteRange(min=0.0, max=10.0), metavar="M",
              help="aided: SD of the noise put on each axis of the position. Default: 0.01.")
@click.option("--pose-loss", "losses", multiple=True, type=FiniteRange(min=0.0, max=1.0, max_open=True),
              metavar="SHARE", help="aided: share of the poses that never arrive. Default: 0.")
@click.option("--attribution", "explained", is_flag=True,
              help="Also attribute the error of the onboard filter. Scores its logged estimate by clock, and the "
                   "filter run again with one thing changed at a time.")
@click.option("--tune-onboard", "tuned", is_flag=True,
              help="Find drag and noise parameters of the onboard filter and score them on held-out flights, instead "
                   "of methods. Writes onboard_parameters.toml to --out. --pose-delay is then the delay on board.")
def estimate(options: Options, protocols: tuple[str, ...], methods: tuple[str, ...], only: bool,
             folders: tuple[Path, ...], rates: tuple[float, ...], delays: tuple[float, ...], noises: tuple[float, ...],
             losses: tuple[float, ...], noise_file: Path | None, explained: bool, tuned: bool) -> int:
    """Task 3: where was it? Scores of state estimators against motion capture.

    Protocols: as-published is the published table with its faults; as-published-corrected corrects them on the same
    recordings; clean scores every distinct flight. Protocol aided gives few, late and noisy poses all along. Protocol
    blackout gives poses until t0, every 5 s, and none afterwards. It scores the estimated position 1, 5, 10 and 20 s
    later (windows in the JSON). Protocol whole-flight gives no pose after take-off. --out DIR holds
    trajectories/<method>/<flight>.tum and trajectories/truth.
    """
    from ..protocols.aided import grid
    from ..protocols.task3 import AIDED, PUBLISHED, check_protocol

    for name in protocols:
        check_protocol(name)
    if tuned:
        if protocols or methods or folders or explained or rates or noises or losses or len(delays) > 1:
            raise UsageError("--tune-onboard goes with --pose-delay S alone: it runs no method but the onboard filter")
        return tune_filter(options, delays[0] if delays else None)
    if (rates or delays or noises or losses) and AIDED not in protocols:
        raise UsageError("--pose-rate, --pose-delay, --pose-noise and --pose-loss go with --protocol aided")
    if only and not methods:
        raise UsageError("--only goes with --method")
    further = load_methods("estimators", methods)
    scored = further if only or folders else None
    if noise_file is not None:
        from estimators.imu_noise import read_imu_noise, reckon_with

        if not further:
            raise UsageError("--imu-noise goes with --method")
        for method in further:
            reckon_with(method, read_imu_noise(noise_file))
    files = trajectory_files(folders)
    flights = options.load()
    audits, _ = options.audit(flights)
    if folders:
        protocols = protocols or ("clean",)
    if options.clock != AS_RECORDED:
        if set(protocols) & set(PUBLISHED):
            raise UsageError(f"--clock {options.clock} goes with --protocol clean, aided, blackout and whole-flight "
                             "only: the published table was made as recorded")
        scored, protocols = further or scored, protocols or ("clean",)
    if not protocols and not methods and nothing_logged(flights):
        protocols = WITHOUT_LOG
        options.say("no onboard estimate is logged: estimators are scored with few poses (aided) and after the last "
                    "one (blackout)")
    aidings = grid(rates, delays, noises, losses)
    body = estimate_body(options, see(options, flights, audits), protocols, scored, files, aidings=aidings,
                         further=further)
    body = replace(body, rankings=ranked_by_clock(options, flights, audits, body, scored, aidings, further) or None)
    if explained:
        body = replace(body, attribution=attribution(options, flights, audits))
    close_estimates(options, body, {method.name for method in further})
    return options.finish("estimate", body)


def tune_filter(options: Options, delay_s: float | None) -> int:
    """``--tune-onboard``: tune_onboard.json and onboard_parameters.toml in ``--out``."""
    from ..pages.task3_tables import onboard_parameters, onboard_tuning
    from ..results.result_files import write_bytes
    from ..steps.onboard_parameters import parameters_toml, tune_onboard_flights, tuning_sentence

    found = tune_onboard_flights(options, options.load(), delay_s)
    content = to_json(found)
    sentence, tables = tuning_sentence(found), [onboard_parameters(content), *onboard_tuning(content)]
    if options.out is None:
        close(options, sentence, "keep the parameters", *again("--out", "tuned"), screen=tables)
    else:
        path = options.out / "onboard_parameters.toml"
        write_bytes(path, parameters_toml(found).encode())
        close(options, f"{sentence}; parameters: {path}", screen=tables)
    return options.finish("tune_onboard", found)


def nothing_logged(flights: Sequence[Flight]) -> bool:
    """Whether no recording has an onboard estimate to score, and one has what dead reckoning needs."""
    from ..auditing.usable import missing
    from ..auditing.verb_needs import INERTIAL, LOGGED

    return (all(missing(flight, LOGGED) is not None for flight in flights)
            and any(missing(flight, INERTIAL) is None for flight in flights))


def close_estimates(options: Options, body: EstimateBody, first: Collection[str] = ()) -> None:
    """The screen of the result, and what ``--verbose`` adds; on the screen the methods ``first`` are the first rows."""
    content = to_json(body)
    screen = {**content, "rows": sorted(content["rows"], key=lambda row: row["method"] not in first)}
    parts = task3_attribution(content["attribution"]) if body.attribution is not None else []
    close_scores(options, estimated(body.rows, body.rankings or ()), "estimator",
                 [*parts, *task3_screen(screen, options.synthetic)],
                 [*parts, *task3(content, options.synthetic), task3_windows(content), task3_consistency(content)],
                 bool(first))
