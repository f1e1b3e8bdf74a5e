"""State of the pipe and the step from one to the next: (line, water, state, mean top velocity, h) -> (state, outputs)."""

from typing import NamedTuple

import numpy as np

from .energy import energies
from .line import Array, Line, Water
from .newton import solve_step
from .step_kernel import element_strains

MAX_CORRECTIONS = 25
CAREFUL_CORRECTIONS = 100
STIFF = np.zeros((6, 6))  # mobility of a top that moves as it is told
WORKS = ("drag", "current", "rotational", "internal", "contact", "numerical")


class PipeState(NamedTuple):
    """Everything that decides the next step; never changed once made."""

    time: float  # s
    position: Array  # (n, 3) phi [m], e
    quaternion: Array  # (n, 4) attitude of the sections
    velocity: Array  # (n, 3) of the centres of the nodes' masses [m/s], e
    rate: Array  # (n, 3) angular velocity [rad/s], material
    flow: Array  # (n, 3) velocity of the added mass [m/s], material; (0, 3) when absent
    strain: Array  # (n - 1, 7) strains and sags
    last: Array  # (n, 6) mean velocities of the last step, for the extrapolation
    before: Array  # (n, 6) those of the step before
    top_work: float  # work done on the pipe at its top since the start [J]
    works: Array  # (6,) work or dissipation since the start [J], in the order of WORKS


class StepResult(NamedTuple):
    """Outcome of one step; when not converged, `state` is the old one."""

    converged: bool
    state: PipeState
    top: Array  # (6,) mean force and moment on the pipe at its top [N, N m], e
    impedance: Array  # (6, 6) d top / d (mean velocity, mean angular velocity)
    iterations: int
    residual: float  # of the largest element force


def rest(line: Line, position: Array, quaternion: Array, time: float) -> PipeState:
    """State of rest in a configuration."""
    n = len(position)
    strain = np.empty((n - 1, 7))
    element_strains(line, position, quaternion, strain)
    zero = np.zeros((n, 3))
    flow = np.zeros((len(line.added_mass), 3))
    return PipeState(time, position, quaternion, zero, zero, flow, strain, np.zeros((n, 6)), np.zeros((n, 6)), 0.0, np.zeros(len(WORKS)))


def step(line: Line, water: Water, state: PipeState, velocity: Array, spin: Array, h: float, mobility: Array = STIFF) -> StepResult:
    """One discretely passive step of length h [s] (step_kernel.py).

    water: at the middle of the step; velocity, spin (3,): mean velocity and angular velocity of the top, in e; or those that it
    would have without the pipe, where it yields to the pipe's pull with `mobility` (6, 6), the derivative of the one by the other.
    """
    top = h * np.concatenate([velocity, spin])
    old = state.position, state.quaternion, state.velocity, state.rate, state.flow, state.strain
    spent = 0
    for guess, careful in ((2.0 * state.last - state.before, False), (state.last, True), (np.zeros_like(state.last), True)):
        limit = CAREFUL_CORRECTIONS if careful else MAX_CORRECTIONS
        converged, x, *new, force, tangent, works, iterations, residual = solve_step(
            line, water, h, *old, h * guess, top, h * mobility, careful, limit
        )
        spent += iterations
        if converged:
            break
    if not line.top_clamped:
        force[3:] = 0.0
    if not converged:
        return StepResult(False, state, force, h * tangent, spent, residual)
    return StepResult(
        True,
        PipeState(
            state.time + h,
            *new,
            last=x / h,
            before=state.last,
            top_work=state.top_work + float(force @ x[-1]),
            works=state.works + works,
        ),
        force,
        h * tangent,
        spent,
        residual,
    )


def energy_of(line: Line, state: PipeState) -> tuple[float, float, float, float]:
    """(kinetic, elastic, gravity, contact) [J]."""
    return energies(line, state.position, state.quaternion, state.velocity, state.rate, state.flow, state.strain)
