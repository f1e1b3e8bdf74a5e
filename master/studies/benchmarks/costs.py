"""What each piece of physics costs: CPU time of a step of the paper's pipe with the piece and without it, in turn.

The pipe heaves 2 m at 12 s. The base has drag in still water, no bed, one section, and torsion and rotational damping as every pipe here:
the element is three-dimensional, and what it leaves out when a scene stays in a plane is nothing.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from master.errors import RunError
from master.studies.benchmarks import statics
from master.studies.hard_cases import swing
from pipe_fmu import AddedMass, Pipe, PipeParameters, Seabed
from pipe_fmu.environment import Environment

STEPS, STEP_S, REPEATS = 200, 0.1, 7
BASE = "drag in still water"


def variants() -> dict[str, PipeParameters]:
    """The scenes compared, by what they add to the base (or leave out of it)."""
    scene = statics.paper()
    water = Environment(depth=scene.environment.depth)
    base = replace(scene, environment=water)
    bare = replace(base.section, drag_normal=0.0, drag_tangential=0.0, rotational_damping=(0.0, 0.0, 0.0))
    halves = tuple(replace(base.section, length=0.5 * base.length) for _ in range(2))
    current = scene.environment.current
    assert current is not None
    steady = replace(water, current=replace(current, start=0.0, ramp=0.0))
    bed = replace(base, seabed=Seabed())
    return {
        BASE: base,
        "no drag": replace(base, section=bare),
        "current": replace(base, environment=steady),
        "seabed": bed,
        "seabed and friction": replace(base, seabed=Seabed(friction=0.5)),
        "added mass": replace(base, added_mass=AddedMass()),
        "internal damping": replace(base, internal_damping=0.01),
        "numerical damping": replace(base, numerical_damping=0.05),
        "two sections": replace(base, sections=halves),
        "no rotational damping": replace(base, section=replace(base.section, rotational_damping=(0.0, 0.0, 0.0))),
        "pinned top": replace(base, top="pinned"),
        "everything": replace(
            base, environment=steady, seabed=Seabed(friction=0.5), added_mass=AddedMass(), internal_damping=0.01, numerical_damping=0.05
        ),
    }  # fmt: skip


def measure(parameters: PipeParameters) -> tuple[float, float]:
    """CPU time [s] of a step, and corrections a step. Raises RunError."""
    pipe, motion, still = Pipe(parameters), swing(2.0, 12.0), np.zeros(3)
    found, state = pipe.start(0.0)
    if not found.converged:
        raise RunError(f"statics failed, residual {found.residual:.1e}")
    pipe.step(state, still, still, STEP_S)  # compiles what is not yet compiled
    corrections = 0
    begin = time.process_time()
    for k in range(STEPS):
        velocity = (motion((k + 1) * STEP_S)[0] - motion(k * STEP_S)[0]) / STEP_S
        result = pipe.step(state, velocity, still, STEP_S)
        if not result.converged:
            raise RunError(f"no convergence at {k * STEP_S:g} s, residual {result.residual:.1e}")
        state, corrections = result.state, corrections + result.iterations
    return (time.process_time() - begin) / STEPS, corrections / STEPS


def sweep(tick: Callable[[], object]) -> list[dict[str, Any]]:
    """A row for every variant, CPU times the medians of interleaved repeats. Raises RunError."""
    wanted = variants()
    spent: dict[str, list[float]] = {name: [] for name in wanted}
    corrections: dict[str, float] = {}
    for _ in range(REPEATS):
        for name, parameters in wanted.items():
            seconds, corrections[name] = measure(parameters)
            spent[name].append(seconds)
            tick()
    each = {name: statistics.median(times) / corrections[name] for name, times in spent.items()}
    return [
        {
            "physics": name, "step_us": 1e6 * statistics.median(spent[name]), "corrections": corrections[name],
            "correction_us": 1e6 * each[name], "of_the_base": each[name] / each[BASE],
        }
        for name in wanted
    ]  # fmt: skip
