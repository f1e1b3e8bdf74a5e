"""Bending moments and stresses of the moving pipe against the number of elements: heave, and snap, where it goes slack and taut again.

Errors are shares of the largest value that occurs, against a run with many more elements at the same steps: of the bending moment at any
node and instant, and of the largest bending moment and von Mises stress along the line, between the nodes too, at any instant.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from scipy.interpolate import CubicSpline

from master.errors import RunError
from master.studies.benchmarks.line import CASES, PIPE
from pipe_fmu import Pipe
from pipe_fmu.results.section_forces import SectionForces
from pipe_fmu.step.state import PipeState

COUNTS, REFERENCE = (24, 48, 96, 192), 512
MESHES: tuple[Literal["adapted", "uniform"], ...] = ("adapted", "uniform")
KEYS = ("nodal_moment", "largest_moment", "largest_von_mises")
_STEP, _DURATION, _EVERY = 0.02, 48.0, 20  # s, s, steps between the instants compared

Moved = tuple[Pipe, list[tuple[PipeState, SectionForces]]]


def moved(name: str, elements: int, mesh: Literal["adapted", "uniform"]) -> Moved:
    """The pipe of a case of `line`, its states and section forces at the instants compared. Raises RunError."""
    pipe, motion, still = Pipe(replace(PIPE, nodes=elements + 1, mesh=mesh)), CASES[name].motion, np.zeros(3)
    found, state = pipe.start(0.0)
    if not found.converged:
        raise RunError(f"statics with {elements} elements failed, residual {found.residual:.1e}")
    kept = []
    for k in range(round(_DURATION / _STEP)):
        velocity = (motion((k + 1) * _STEP)[0] - motion(k * _STEP)[0]) / _STEP
        result = pipe.step(state._replace(time=k * _STEP), velocity, still, _STEP)
        if not result.converged:
            raise RunError(f"{elements} elements: no convergence at {k * _STEP:g} s, residual {result.residual:.1e}")
        state = result.state
        if (k + 1) % _EVERY == 0:
            kept.append((state, pipe.section_forces(state)))
    return pipe, kept


def errors(found: Moved, exact: Moved) -> np.ndarray:
    """Largest errors (3,) over all instants, in the order of KEYS."""
    (pipe, mine), (fine, right) = found, exact

    def largest(of: Pipe, state: PipeState, forces: SectionForces) -> tuple[float, float]:
        return of.largest_bending_moment(forces), of.largest_von_mises(state, forces)

    ours, theirs = (np.array([largest(of, *one) for one in many]) for of, many in (found, exact))
    scale = theirs.max(axis=0)
    at_nodes = [np.abs(a.moment - CubicSpline(fine.s, b.moment)(pipe.s))[:, 1:].max() for (_, a), (_, b) in zip(mine, right, strict=True)]
    return np.array([max(at_nodes) / scale[0], *(np.abs(ours - theirs).max(axis=0) / scale)])


def sweep(counts: Sequence[int], tick: Callable[[], object]) -> list[dict[str, Any]]:
    """A row for every case, mesh and number of elements. Raises RunError."""
    rows = []
    for name in ("heave", "snap"):
        exact = moved(name, REFERENCE, "adapted")
        tick()
        for mesh in MESHES:
            for elements in counts:
                found = errors(moved(name, elements, mesh), exact)
                rows.append({"case": name, "mesh": mesh, "elements": elements} | dict(zip(KEYS, found.tolist(), strict=True)))
                tick()
    return rows
