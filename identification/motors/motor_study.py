"""Everything found on one set of logs: which lag, which map, k_f, moments, and what each input is worth."""

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from identification.thrust.map_export import export
from identification.thrust.stand_fit import Fit
from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.physics.vehicle import BOUNDS
from nanobench_tools.protocols.sessions import labels_of
from nanobench_tools.settings import count, setting

from . import lag as lagging
from . import rotation as turning
from . import steady_speed, torque
from .force import ONE_VEHICLE, Force, errors, fit_force
from .rotor_rows import Log, read_logs

MOST_FOLDS = count("motors.motor_study.most_folds")
AGREES = setting("motors.motor_study.agrees")


@dataclass(frozen=True)
class Scores:
    """Mean errors of one input: by flight (F, 50) of each kind, windows (F,), how often each parameter's fit failed."""

    by_flight: Mapping[str, np.ndarray]
    windows: np.ndarray
    troubles: tuple[str, ...] = ()


@dataclass
class Study:
    """Results on ``logs``; ``folds`` [(train, test)] are numbers of logs. ``lags``: candidates fitted to all training
    flights; ``fold_lags``: to those of every fold; ``lag_rms`` (F,) rad/s held out, by candidate; ``lag``: the
    chosen one; ``rotation``: scores by input; ``models``: fitted to all training flights. ``mass_known``: whether
    k_f and moments of inertia are more than ratios to a mass."""

    logs: list[Log]
    folds: list[tuple[list[int], list[int]]]
    vehicle: Vehicle
    mass_known: bool
    reasons: Mapping[str, str]
    force: Force
    base: Model
    lags: dict[str, lagging.Lag] = field(default_factory=dict)
    fold_lags: dict[str, list[lagging.Lag]] = field(default_factory=dict)
    lag_rms: dict[str, np.ndarray] = field(default_factory=dict)
    lag_by_flight: list[lagging.Lag | None] = field(default_factory=list)
    lag_ci95: dict[str, list[float]] = field(default_factory=dict)
    best_lag: str = ""
    windows: lagging.Windows | None = None
    chosen: steady_speed.Chosen | None = None
    force_rms: dict[str, np.ndarray] = field(default_factory=dict)
    axes: dict[str, list[torque.Axis | None]] = field(default_factory=dict)
    rotation: dict[str, Scores] = field(default_factory=dict)
    models: dict[str, turning.Rotation] = field(default_factory=dict)

    @property
    def sessions(self) -> np.ndarray:
        """(F,) session of every log, -1 where its clock started with the vehicle."""
        return labels_of(self.logs)

    @property
    def train(self) -> list[int]:
        return sorted({i for train, _ in self.folds for i in train})

    @property
    def test(self) -> list[int]:
        return sorted({i for _, test in self.folds for i in test})

    @property
    def k_f(self) -> float:
        """N s^2/rad^2."""
        return self.force.k_f_per_kg * self.vehicle.mass_kg

    @property
    def lag(self) -> lagging.Lag:
        return self.lags[self.best_lag]

    @property
    def step_s(self) -> float:
        """What the rows of 10 ms really are."""
        from .radio import coarse_rows

        return coarse_rows(self.logs[0].row_s) * self.logs[0].row_s

    @property
    def slopes(self) -> tuple[float, float]:
        """dT / d(u V) [N/V] of the mean motor in hover: from changes within a second, and of the chosen steady map."""
        fast = self.lag.model.values_of("thrust_voltage")["c"][1] * float(np.mean(self.lag.gain))
        slow = float("nan")
        if self.chosen is not None and self.chosen.best is not None:
            u = np.concatenate([log.joined(log.u) for log in self.logs]).mean()
            voltage = np.concatenate([log.joined(log.battery_V) for log in self.logs]).mean()
            fit = self.chosen.fits[self.chosen.best].fit
            slow = float((fit.predict(1.01 * u, voltage) - fit.predict(0.99 * u, voltage)) / (0.02 * u * voltage))
        return fast, slow


def identify(train: Iterable[Flight | str | Path], test: Iterable[Flight | str | Path] | None = None, *,
             mass_kg: float | None = None, vehicle: Vehicle | None = None, seed: int = 0,
             progress: Callable[[int, int], None] = lambda done, total: None) -> Study:
    """Everything from recordings (flights, files, folders); without ``test`` flights are held out in turn.

    mass_kg: of the vehicle with battery. Without it only k_f / m is known, and the vehicle's mass is used.
    ``progress`` gets the number of finished and of all fits. InputError for flights that cannot be used, one flight
    alone, or flights of different vehicles.
    """
    parts = [_load(train), *([] if test is None else [_load(test)])]
    if mass_kg is not None and not BOUNDS["mass_kg"][0] <= mass_kg <= BOUNDS["mass_kg"][1]:
        raise InputError(f"mass {mass_kg:g} kg", "outside {:g} to {:g} kg".format(*BOUNDS["mass_kg"]),
                         "is it in grams?")
    frame = vehicle or Vehicle()
    frame = replace(frame, mass_kg=frame.mass_kg if mass_kg is None else mass_kg)
    logs, reasons = read_logs([f for part in parts for f in part])
    places = [{f.provenance.path for f in part} for part in parts]
    _enough(logs, reasons, places, parts[0][0].provenance.path if parts[0] else "flights")
    _one_vehicle(logs)
    if test is None:
        groups = min(MOST_FOLDS, len(logs))
        folds = [([i for i in range(len(logs)) if i % groups != g], list(range(g, len(logs), groups)))
                 for g in range(groups)]
    else:
        folds = [([i for i, log in enumerate(logs) if log.path in places[0]],
                  [i for i, log in enumerate(logs) if log.path not in places[0]])]
    learn = [logs[i] for i in sorted({i for a, _ in folds for i in a})]
    study = Study(logs, folds, frame, mass_kg is not None, reasons, fit_force(learn, seed), hover(learn, frame))
    total = (len(lagging.CANDIDATES) + len(turning.INPUTS)) * (len(folds) + 1) + len(logs)
    done = itertools.count(1)

    def fitted() -> None:
        progress(min(next(done), total), total)

    _lags(study, seed, fitted)
    _steady(study)
    _torque(study)
    _rotation(study, seed, fitted)
    return study


def hover(logs: Sequence[Log], vehicle: Vehicle) -> Model:
    """The straight map of ``lag.hover_model`` on a vehicle, with the k_f of the same flights."""
    base = lagging.hover_model(logs, fit_force(logs).k_f_per_kg * vehicle.mass_kg, vehicle.mass_kg)
    return Model(replace(vehicle, rate_hz=base.vehicle.rate_hz), base.as_dict())


def _load(sources: Iterable[Flight | str | Path]) -> list[Flight]:
    from nanobench_tools.sources.discover import load_recordings

    given = list(sources)
    flights = [s for s in given if isinstance(s, Flight)]
    if paths := [Path(s) for s in given if not isinstance(s, Flight)]:
        flights += load_recordings(paths).flights
    return flights


def _enough(logs: Sequence[Log], reasons: Mapping[str, str], places: Sequence[set[str]], place: str) -> None:
    more = f" (and {len(reasons) - 1} more)" if len(reasons) > 1 else ""
    if not logs:
        first = next(iter(reasons.items()), ("no recording", "nothing was read"))
        raise InputError(place, f"no flight with measured rotor speed can be used: {first[0]}: {first[1]}{more}")
    if len(logs) < 2:
        raise InputError(logs[0].path, "one flight only", "nothing is left to hold out; give two or more flights"
                         + "".join(f"; {n} is left out: {r}" for n, r in list(reasons.items())[:1]))
    for side, known in zip(("train", "test"), places, strict=False):
        if len(places) > 1 and not any(log.path in known for log in logs):
            why = next((f"; {n} is left out: {r}" for n, r in reasons.items()), "")
            raise InputError(place, f"no flight to {side} on can be used{why}")


def _one_vehicle(logs: Sequence[Log]) -> None:
    single = {log.name: fit_force([log]).k_f_per_kg for log in logs}
    least, most = min(single, key=single.__getitem__), max(single, key=single.__getitem__)
    if single[most] > ONE_VEHICLE * single[least]:
        raise InputError(next(log.path for log in logs if log.name == most),
                         f"another vehicle than {least}: thrust per mass and squared rotor speed {single[most]:.3g} "
                         f"against {single[least]:.3g}", "give the flights of one vehicle at a time")


def _lags(study: Study, seed: int, fitted: Callable[[], None]) -> None:
    row_s = study.logs[0].row_s
    data = lagging.windows_of(study.logs)
    if not len(data.u):
        raise InputError(study.logs[0].path, f"no {lagging.WINDOW_S + lagging.BEFORE_S:.1f} s without a gap in the log",
                         "a lag needs rows in one piece")
    study.windows = data
    bases = [hover([study.logs[i] for i in train], study.vehicle) for train, _ in study.folds]
    for name in lagging.CANDIDATES:
        rms = np.full(len(study.logs), np.nan)
        study.fold_lags[name] = []
        for base, (train, _) in zip(bases, study.folds, strict=True):
            study.fold_lags[name].append(lagging.fit_lag(base, data, row_s, name, np.array(train)))
            fitted()
        for fit, (_, test) in zip(study.fold_lags[name], study.folds, strict=True):
            tested = [i for i in test if np.any(data.flight == i)]
            rms[tested] = lagging.held_out_rms(fit, data, row_s, tested)
        study.lag_rms[name] = rms
        study.lags[name] = lagging.fit_lag(study.base, data, row_s, name, np.array(study.train))
        fitted()
    able = {n: fit.rms_rad_s for n, fit in study.lags.items() if not fit.trouble}
    study.best_lag = next(n for n in able if able[n] <= lagging.NO_WORSE * min(able.values()))
    study.lag_ci95 = lagging.intervals(study.lags["up and down + delay"], seed=seed,
                                       sessions=study.sessions[np.intersect1d(study.train, data.flight)])
    for i in range(len(study.logs)):
        study.lag_by_flight.append(lagging.fit_lag(study.base, data, row_s, "up and down + delay", np.array([i]))
                                   if np.any(data.flight == i) else None)
        fitted()


def _steady(study: Study) -> None:
    blocks = [steady_speed.blocks_of(log, study.lag) for log in study.logs]
    learn = study.train
    study.chosen = steady_speed.choose_steady([blocks[i] for i in learn], study.k_f)
    rms: dict[str, np.ndarray] = {n: np.full(len(study.logs), np.nan) for n in ("rotor speed", "PWM and voltage")}
    best = study.chosen.best
    for train, test in study.folds:
        k_f = fit_force([study.logs[i] for i in train]).k_f_per_kg * study.vehicle.mass_kg
        fitted = None if best is None else steady_speed.fit_steady(
            steady_speed.CANDIDATES[best], [blocks[i] for i in train], k_f, study.chosen.fits[best].fit.shape or None)
        for i in test:
            log = study.logs[i]
            per_kg = k_f / study.vehicle.mass_kg
            rms["rotor speed"][i] = _rms(errors(log, per_kg * np.sum(log.speed**2, axis=1)))
            if fitted is not None and fitted.fit.values:
                speed = fitted.speed(steady_speed.lagged(log, study.lag), log.battery_V)
                rms["PWM and voltage"][i] = _rms(errors(log, per_kg * np.sum(speed**2, axis=1)))
    study.force_rms = rms


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _torque(study: Study) -> None:
    study.axes = {"x": [], "y": [], "z": [], "z_drag": []}
    for log in study.logs:
        found = torque.moments(log, study.vehicle, study.k_f)
        for number, axis in enumerate("xyz"):
            study.axes[axis].append(torque.regress(log, number, found[axis]))
        study.axes["z_drag"].append(torque.regress(log, 2, found["z"][:, :1]))


def inertia(study: Study, train: Sequence[int] | None = None) -> tuple[float, float, float]:
    """kg m^2 about x and y from the rotor speeds of flights ``train``; about z the vehicle's own."""
    values = []
    for axis, own in zip("xy", study.vehicle.inertia_kg_m2, strict=False):
        known = [found.values[0] for i in (study.train if train is None else train)
                 if (found := study.axes[axis][i]) is not None]
        values.append(1.0 / float(np.median(known)) if known and np.median(known) > 0.0 else own)
    return values[0], values[1], study.vehicle.inertia_kg_m2[2]


def _rotation(study: Study, seed: int, fitted: Callable[[], None]) -> None:
    """Nothing of a fold's test flights is in its models: neither lag nor k_f nor moments of inertia."""
    for kind in turning.INPUTS:
        found = turning.batch(study.logs, kind, seed)
        if found is None or not np.isin(found.flight, study.train).any():
            return
        data = found
        model = turning.rotation_model(study.lag, kind, inertia(study), 1.0 / data.row_hz)
        study.models[kind.name] = turning.fit_rotation(model, data.part(np.isin(data.flight, study.train)),
                                                        kind.own_lag)
        fitted()
        if kind.own_lag:
            continue  # shows the lag that an input implies on its own; not scored
        parts, troubles = [], []
        for (train, test), lag in zip(study.folds, study.fold_lags[study.best_lag], strict=True):
            learn, held = (data.part(np.isin(data.flight, which)) for which in (train, test))
            if not len(learn.start) or not len(held.start):
                continue
            model = turning.rotation_model(lag, kind, inertia(study, train), 1.0 / data.row_hz)
            fit = turning.fit_rotation(model, learn, kind.own_lag)
            fitted()
            troubles += [fit.trouble] if fit.trouble else []
            parts.append((held.flight, turning.errors(fit, held)))
        if not parts:
            return
        study.rotation[kind.name] = _scores(parts, len(study.logs), tuple(troubles))
    last = study.rotation[kind.name].windows
    tested = data.part(last[data.flight] > 0)
    study.rotation["still"] = _scores([(tested.flight, turning.errors(None, tested))], len(study.logs), ())


def _scores(parts: Sequence[tuple[np.ndarray, Mapping[str, np.ndarray]]], flights: int,
            troubles: tuple[str, ...]) -> Scores:
    flight = np.concatenate([f for f, _ in parts])
    counts = np.bincount(flight, minlength=flights)
    by_flight = {}
    for name in parts[0][1]:
        values = np.concatenate([found[name] for _, found in parts])
        total = np.zeros((flights, values.shape[1]))
        np.add.at(total, flight, values)
        with np.errstate(invalid="ignore"):
            by_flight[name] = total / counts[:, None]
    return Scores(by_flight, counts, troubles)


def simulator(study: Study) -> Model:
    """The vehicle for simulator.toml: thrust map, lag, moments of the model that was fitted at the rows of the log.

    The map is the steady one where fast and slow changes agree on its slope. Otherwise it is the straight line of the
    fast ones, which is valid near hover only. The moments are those that predict rates over 100 ms best; where that
    fit is none, inertia is that of ``torque``. Delays of sensors are left out.
    """
    fast, slow = study.slopes
    if study.chosen is not None and study.chosen.best is not None and abs(slow / fast - 1.0) < AGREES:
        fit: Fit = study.chosen.fits[study.chosen.best].fit
        u = np.concatenate([log.joined(log.u).ravel() for log in study.logs])
        voltage = np.concatenate([log.joined(log.battery_V) for log in study.logs])
        exported = export(fit, tuple(np.quantile(u, (0.005, 0.995))), tuple(np.quantile(voltage, (0.02, 0.98))))
        terms = {term["name"]: {k: v for k, v in term.items() if k != "name"} for term in exported.terms}
    else:
        terms = {"thrust_voltage": study.lag.model.values_of("thrust_voltage")}
    terms |= {"motor_lag": {"tau_up_s": study.lag.tau_up_s, "tau_down_s": study.lag.tau_down_s},
              "thrust_rpm": {"k_f": study.k_f}}
    vehicle = replace(study.vehicle, inertia_kg_m2=inertia(study))
    fitted = study.models.get("logged")
    if fitted is not None and not fitted.trouble:
        own = fitted.model.as_dict()
        vehicle = replace(vehicle, inertia_kg_m2=own["inertia"]["inertia_kg_m2"])
        terms |= {name: own[name] for name in ("yaw_torque", "rotor_reaction", "drag_torque", "angular_damping")}
    return Model(vehicle, terms)
