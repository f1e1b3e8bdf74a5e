"""Pipe and vessel solved together in one loop, without FMI: the reference for co-simulation.

A step solves for the mean velocity V of the hang-off point at which both models agree, V = vessel(-F), F = pipe(V), by Newton's method with
the exact condensed tangents Z = dF/dV of the pipe and Y = dV/df of the vessel; that is Newton's method on all unknowns with both interiors
condensed onto the hang-off point. With one pipe step per macro step the converged co-simulation must give the same states.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from master.errors import RunError
from master.run.pipe_drive import LOADS
from master.scene.reading import Scene
from master.scene.sections import mean_load
from master.with_units.statics import equilibrium, released
from pipe_fmu import Pipe
from pipe_fmu.step.state import PipeState
from vessel_fmu.vessel import Inputs, State, Vessel

_TOLERANCE = 1e-12  # of the velocity: near round-off
_ROUND_OFF = 1e-11  # of the velocity that the pull gives the vessel: what the pipe's own tolerance leaves
_ROUNDS = 25


@dataclass(frozen=True)
class Instant:
    """Both states at one time, and the mean pull [N, N m] on the pipe's top and mean velocity over the step that led there."""

    time: float
    pipe: PipeState
    vessel: State
    force: np.ndarray
    velocity: np.ndarray
    pipe_solves: int


def march(scene: Scene, macro_step: float | None = None, duration: float | None = None) -> tuple[Pipe, Vessel, Iterator[Instant]]:
    """The two models of a scene and an iterator over its instants, the start included.

    Raises UsageError for a scene the units refuse; the iterator raises RunError where a step does not converge.
    """
    at = released(scene, equilibrium(scene))
    if at.vessel is None:
        raise ValueError("a pipe alone has nothing to be coupled with")
    pipe, vessel = Pipe(at.pipe), Vessel(at.vessel)
    simulation = scene.sections.simulation
    h, end = macro_step or simulation.macro_step, duration or simulation.duration
    return pipe, vessel, _instants(scene, pipe, vessel, h, round(end / h))


def _instants(scene: Scene, pipe: Pipe, vessel: Vessel, h: float, steps: int) -> Iterator[Instant]:
    found, state = pipe.start(0.0)
    now = Instant(0.0, state, vessel.start(), found.top, np.zeros(6), 0)
    before = now.velocity
    yield now
    tables = scene.sections.tables
    for k in range(steps):
        load = dict(zip(LOADS[tables.frame], mean_load(tables.environment, k * h, h), strict=True)) if tables else {}
        after = _step(pipe, vessel, now, 2.0 * now.velocity - before, k * h, h, load)
        before, now = now.velocity, after
        yield now


def _step(pipe: Pipe, vessel: Vessel, now: Instant, guess: np.ndarray, time: float, h: float, load: dict[str, np.ndarray]) -> Instant:
    """The instant h [s] later. Raises RunError."""
    velocity, error = guess, np.inf
    for rounds in range(1, _ROUNDS + 1):
        piped = pipe.step(now.pipe._replace(time=time), velocity[:3], velocity[3:], h)
        inputs = Inputs(force=-piped.top[:3], moment=-piped.top[3:], **load)
        moved = vessel.step(now.vessel, time, h, inputs)
        if not (piped.converged and moved.converged):
            break
        gap = moved.state.mean_velocity - velocity
        error = float(np.abs(gap).max())
        given = float((np.abs(moved.state.mobility) @ np.abs(piped.top)).max())
        if error <= _TOLERANCE * float(np.abs(velocity).max()) + _ROUND_OFF * given:
            return Instant(time + h, piped.state, moved.state, piped.top, velocity, rounds)
        velocity = velocity + np.linalg.solve(np.eye(6) + moved.state.mobility @ piped.impedance, gap)
    raise RunError(f"monolithic step of {h:g} s at t = {time:g} s: no agreement after {_ROUNDS} rounds, velocity gap {error:.1e}")
