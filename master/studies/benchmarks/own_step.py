"""Contestants: our step, called in-process, and the pipe's FMU moved by the master.

Steps longer than the time between the instants compared are interpolated by cubic splines.
"""

from __future__ import annotations

import time

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from master.errors import RunError
from master.studies.benchmarks.histories import SAMPLE, Histories, LineCase, Setting, instants
from master.studies.benchmarks.through_fmus import apart, march
from pipe_fmu import Pipe, PipeParameters
from pipe_fmu.maths.so3 import matrix
from pipe_fmu.step.state import PipeState

_SAME = 1e-6  # m: nodes of the FMU and of the step in-process, with the same nodes and steps


def run(parameters: PipeParameters, case: LineCase, setting: Setting) -> tuple[float, Histories]:
    """CPU time of the steps [s] (statics, compilation and evaluation outside the clock) and the histories. Raises RunError."""
    spent, pipe, kept, top = _march(parameters, case, setting)
    return spent, _histories(pipe, kept, top, setting.step_s, instants(case.duration))


def run_fmu(parameters: PipeParameters, case: LineCase, setting: Setting) -> tuple[float, Histories]:
    """As `run`, through the pipe's FMU in a process of its own; the nodes must be those of the step in-process. Raises RunError."""
    changes = (f"pipe.nodes={setting.elements + 1}", f"pipe.mesh='{setting.mesh}'", f"simulation.macro_step={setting.step_s!r}")
    found = apart(march, "heave", [*case.changes, *changes], instants(case.duration), [("pipe", "node_position")])
    spent, nodes = found[0], found[1][0].reshape(-1, setting.elements + 1, 3)
    _, pipe, kept, top = _march(parameters, case, setting)
    gap = float(np.abs(np.array([state.position for state in kept[1:]])[: len(nodes)] - nodes).max())
    if gap > _SAME:
        raise RunError(f"the FMU's nodes are up to {gap:.1e} m from those of the step in-process")
    return spent, _histories(pipe, kept, top, setting.step_s, instants(case.duration))


def _march(parameters: PipeParameters, case: LineCase, setting: Setting) -> tuple[float, Pipe, list[PipeState], np.ndarray]:
    """CPU time [s], the pipe, its states every SAMPLE or, where they are longer, every step, and the mean top forces (k, 3) [N]."""
    pipe = Pipe(parameters)
    found, state = pipe.start(0.0)
    if not found.converged:
        raise RunError(f"statics with {setting.elements} elements failed, residual {found.residual:.1e}")
    h, still, motion = setting.step_s, np.zeros(3), case.motion
    every = max(1, round(SAMPLE / h))
    pipe.step(state, still, still, h)  # compiles what is not yet compiled
    kept, forces = [state], []
    begin = time.process_time()
    for k in range(round(case.duration / h)):
        result = pipe.step(state._replace(time=k * h), (motion((k + 1) * h)[0] - motion(k * h)[0]) / h, still, h)
        if not result.converged:
            raise RunError(f"{setting.elements} elements, step {h:g} s: no convergence at {k * h:g} s, residual {result.residual:.1e}")
        state = result.state
        forces.append(result.top[:3])
        if (k + 1) % every == 0:
            kept.append(state)
    spent = time.process_time() - begin
    return spent, pipe, kept, np.array(forces)


def _histories(pipe: Pipe, kept: list[PipeState], top: np.ndarray, step: float, times: np.ndarray) -> Histories:
    bending = np.array([pipe.largest_bending_moment(pipe.section_forces(state)) for state in kept])
    places = np.array([quarters(pipe, state.position, state.quaternion) for state in kept])
    if step > SAMPLE:
        ends, middles = step * np.arange(len(kept)), step * (np.arange(len(top)) + 0.5)
        return Histories(CubicSpline(ends, places)(times), CubicSpline(middles, top)(times), CubicSpline(ends, bending)(times))
    last, at = len(times) + 1, round(SAMPLE / step) * np.arange(1, len(times) + 1)
    return Histories(places[1:last], 0.5 * (top[at - 1] + top[at]), bending[1:last])


def quarters(pipe: Pipe, position: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
    """Positions (3, 3) at L/4, L/2 and 3L/4, by Hermite's cubic along the first axes of the sections."""
    along = np.array([np.array(matrix(tuple(q)))[:, 0] for q in quaternion])
    curve = CubicHermiteSpline(pipe.s, position, along)
    return np.asarray(curve(pipe.s[-1] * np.array([0.25, 0.5, 0.75])))
