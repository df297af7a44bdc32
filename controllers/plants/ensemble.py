"""Plants that the vehicle may be: parameters as flights drawn anew identify them, loads, batteries, delays, air,
noise."""

from __future__ import annotations

import csv
from dataclasses import dataclass, replace
from importlib import resources

import numpy as np

from nanobench_tools.physics import Model
from nanobench_tools.physics.simulator import loads
from nanobench_tools.practice.estimator import correlated_noise
from nanobench_tools.practice.vehicle_parameters import VEHICLE
from nanobench_tools.settings import number, setting

from .plant import Cell, Plant, closed_loop_model, hover_ratio
from .senses import Sensing

DELAY_S = (0.010, 0.040)
HOVER_V = setting("control.ensemble.hover_v")
PAYLOAD = 0.10
DRAG = 0.20
"""Drag and its moment are between 1 - DRAG and 1 + DRAG of the identified ones, in addition to the scatter of the
draws."""
NOISE = (0.5, 2.0)
"""Sensor noise over that of the recordings."""
MEDIAN_DELAY_S = 0.03
MEDIAN_HOVER_V = number("control.ensemble.median_hover_v")
GUST_S = number("control.ensemble.gust_s")
SHIPPED = "recorded_vehicle.toml"
DRAWS = "recorded_vehicle_draws.csv"


def shipped_simulator() -> str:
    """Text of the simulator.toml of the recorded vehicle that comes with the package."""
    return resources.files(__package__).joinpath(SHIPPED).read_text(encoding="utf-8")


def shipped_draws() -> tuple[tuple[str, ...], np.ndarray]:
    """(names, values (k, P)) of its parameters: sessions of the training flights drawn anew, then flights, and priors.
    Of the flights, 12, 1 and 2 are of the three sessions, so the draws are somewhat too narrow."""
    with resources.files(__package__).joinpath(DRAWS).open(encoding="utf-8") as lines:
        names, *rows = list(csv.reader(lines))
    return tuple(names), np.array(rows, float)


@dataclass(frozen=True)
class Ensemble:
    """n plants of one structure: parameters (n, P) of ``model``, and their batteries, senses and air.

    ``push_m_s2`` (n,): spread of the acceleration from turbulence. ``radio_s`` (n,): further delay of commands to the
    motors if a controller is not on board. ``seeds`` (n,): each plant has its own random numbers, so it does not depend
    on the others.
    """

    model: Model
    parameters: np.ndarray
    hover_V: np.ndarray
    resistance_ohm: np.ndarray
    delay_s: np.ndarray
    noise: np.ndarray
    push_m_s2: np.ndarray
    radio_s: np.ndarray
    seeds: tuple[tuple[int, ...], ...]

    def __len__(self) -> int:
        return len(self.parameters)

    def repeated(self, times: int) -> Ensemble:
        """The whole ensemble ``times`` times, one after the other."""
        rows = {name: np.concatenate([getattr(self, name)] * times) for name in (
            "parameters", "hover_V", "resistance_ohm", "delay_s", "noise", "push_m_s2", "radio_s")}
        return Ensemble(self.model, seeds=self.seeds * times, **rows)

    def plant(self, position_m: np.ndarray, late: bool = False) -> Plant:
        """Hovering at position_m (n, 3); ``late``: its commands come by radio."""
        n = len(self)
        start = np.zeros((n, 13))
        start[:, :3], start[:, 9] = position_m, 1.0
        ratio = hover_ratio(self.model, self.hover_V, self.parameters)
        conductance = np.full(n, VEHICLE["motor_conductance_A_V"].value)
        load = 4.0 * self.resistance_ohm * conductance * ratio**2
        cell = Cell(self.hover_V * (1.0 + load), self.resistance_ohm, conductance)
        model, parameters = self._by_radio() if late and self.radio_s.any() else (self.model, self.parameters)
        return Plant(model, start, np.repeat(ratio[:, None], 4, axis=1), cell, parameters=parameters)

    def _by_radio(self) -> tuple[Model, np.ndarray]:
        """Model and parameters with the radio's delay added to the commands'."""
        known = "command_delay" in self.model
        model = self.model if known else self.model.with_term("command_delay", delay_s=0.0)
        parameters = _moved(self.model, self.parameters, model)
        parameters[:, model.index("command_delay.delay_s")] += self.radio_s
        return model, parameters

    def in_wind(self, speed_m_s: float) -> Ensemble:
        """The same in a steady level wind, from a separate direction for every plant, through the model's drag."""
        if speed_m_s == 0.0:
            return self
        angle = np.array([rng.uniform(0.0, 2.0 * np.pi) for rng in self.rngs(3)])
        model = self.model if "wind" in self.model else self.model.with_term("wind", w_m_s=(0.0, 0.0, 0.0))
        parameters = _moved(self.model, self.parameters, model)
        for axis, share in enumerate((np.cos(angle), np.sin(angle))):
            parameters[:, model.index(f"wind.w_m_s[{axis}]")] += speed_m_s * share
        return replace(self, model=model, parameters=parameters)

    def sensing(self, outages: tuple[tuple[float, float], ...] = ()) -> Sensing:
        """Of every plant its own."""
        return Sensing(self.delay_s, self.noise, outages)

    def rngs(self, purpose: int) -> list[np.random.Generator]:
        """One generator for each plant."""
        return [np.random.default_rng([*seed, purpose]) for seed in self.seeds]

    def air_N(self, ticks: int) -> np.ndarray:
        """(ticks, 3, n) N: unrest of the air every 10 ms."""
        mass = self.parameters[:, self.model.index("mass.m")]
        drawn = [correlated_noise(rng, ticks, 3, GUST_S) for rng in self.rngs(1)]
        return np.asarray(np.stack(drawn, axis=-1) * (self.push_m_s2 * mass))


def draw(simulator: str, n: int, seed: int = 0, draws: tuple[tuple[str, ...], np.ndarray] | None = None,
         radio_s: float = 0.0) -> Ensemble:
    """The median plant and n - 1 others about a simulator.toml (its text), behind a radio of ``radio_s``.

    draws: (names, values (k, P)) of an identification of this simulator. Without them, parameters scatter as those of
    the shipped one do (relative to their mean, by name).
    """
    model = closed_loop_model(loads(simulator))
    if "motor_imbalance" not in model:
        model = model.with_term("motor_imbalance", g=(1.0,) * 4)
    names, values = draws or shipped_draws()
    middle = values.mean(axis=0)
    ratio = np.where(np.abs(middle) > 1e-12, values / np.where(np.abs(middle) > 1e-12, middle, 1.0), 1.0)
    parameters = np.tile(model.values, (n, 1))
    rest = {name: np.empty(n) for name in ("hover_V", "resistance_ohm", "delay_s", "noise")}
    seeds = tuple((seed, i) for i in range(n))
    for i in range(n):
        median = i == 0
        rng = np.random.default_rng([*seeds[i], 0])
        row = ratio[rng.integers(len(ratio))]
        for name, factor in zip(names, row, strict=True):
            if name in model.names and not median:
                parameters[i, model.index(name)] *= factor
        load, drag, moment, volt, delay, cell = rng.uniform(-1.0, 1.0, 6)
        noise = np.exp(rng.uniform(np.log(NOISE[0]), np.log(NOISE[1]), 2))[1]  # two, so that plants stay as they were
        imbalance = 0.6 * VEHICLE["motor_imbalance"].spread * rng.standard_normal(4)
        if not median:
            _scale(model, parameters[i], "mass.m", 1.0 + PAYLOAD * load)
            _scale(model, parameters[i], "drag_linear.", 1.0 + DRAG * drag)
            _scale(model, parameters[i], "drag_torque.", 1.0 + DRAG * moment)
            for k in range(4):
                parameters[i, model.index(f"motor_imbalance.g[{k}]")] += imbalance[k] - imbalance.mean()
        rest["hover_V"][i] = MEDIAN_HOVER_V if median else _between(HOVER_V, volt)
        rest["delay_s"][i] = MEDIAN_DELAY_S if median else _between(DELAY_S, delay)
        resistance = VEHICLE["resistance_ohm"]
        rest["resistance_ohm"][i] = resistance.value + (0.0 if median else 2.0 * resistance.spread * cell)
        rest["noise"][i] = 1.0 if median else noise
    return Ensemble(model, parameters, push_m_s2=np.full(n, VEHICLE["disturbance_m_s2"].value),
                    radio_s=np.full(n, radio_s), seeds=seeds, **rest)


def _moved(model: Model, values: np.ndarray, other: Model) -> np.ndarray:
    """Parameters (n, P) of ``model`` as those of ``other``, which has its terms and more."""
    found = np.tile(other.values, (len(values), 1))
    for i, name in enumerate(model.names):
        found[:, other.index(name)] = values[:, i]
    return found


def _between(ends: tuple[float, float], share: float) -> float:
    return 0.5 * (ends[0] + ends[1]) + 0.5 * (ends[1] - ends[0]) * share


def _scale(model: Model, row: np.ndarray, name: str, factor: float) -> None:
    """Scales every parameter whose flat name is or begins with ``name``."""
    for i, full in enumerate(model.names):
        if full == name or full.startswith(name):
            row[i] *= factor
