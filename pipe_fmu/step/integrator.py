"""State of rest, and the step from one state to the next: (line, water, state, mean top velocity, h) -> (state, outputs)."""

from typing import NamedTuple

import numpy as np

from ..arrays import Array
from ..compiled import inlined, kernel
from ..element.strains import INSIDE_OUT, ROWS, chords, inverted
from ..line import Line, Water
from .energy import energies
from .newton import solve_step
from .state import WORKS, PipeState
from .system import element_strains, folded

_COUNT = len(WORKS)
STIFF = np.zeros((6, 6))  # mobility of a top that moves as it is told
# Searches for a step's solution: the guess of the mean velocities, from those of the last three steps; all but the first are damped
_SEARCHES = ((3.0, -3.0, 1.0), (1.0, 0.0, 0.0), (0.0, 0.0, 0.0))
FLAWS = ("", "bent or twisted past half a turn between its nodes", INSIDE_OUT)  # of an element, for which a step is refused


class StepResult(NamedTuple):
    """Outcome of one step; when not converged, `state` is the old one."""

    converged: bool
    state: PipeState
    top: Array  # (6,) mean force and moment on the pipe at its top [N, N m], e
    impedance: Array  # (6, 6) d top / d (mean velocity, mean angular velocity)
    iterations: int
    residual: float  # over the largest element force and 1e-3 of the inertial terms
    flaw: str = ""  # what an element would be in the new state, for which the step is refused; else empty


@kernel
def rest(line, position, quaternion, time):
    """State of rest in a configuration."""
    n = position.shape[0]
    strain = np.empty((n - 1, ROWS))
    element_strains(line, position, quaternion, strain)
    zero, still = np.zeros((n, 3)), np.zeros((n, 6))
    added_mass_velocity, works = np.zeros((line.added_mass.shape[0], 3)), np.zeros(_COUNT)
    chord = chords(line.length, position)
    return PipeState(time, position, quaternion, zero, zero, added_mass_velocity, strain, chord, still, still, still, 0.0, works)


def step(line: Line, water: Water, state: PipeState, velocity: Array, spin: Array, h: float, mobility: Array = STIFF) -> StepResult:
    """One discretely passive step of length h [s] (step/system.py).

    water: at the middle of the step; velocity, spin (3,): mean velocity and angular velocity of the top, in e; or those that it
    would have without the pipe, where it yields to the pipe's pull with `mobility` (6, 6), the derivative of the one by the other.
    """
    converged, new, top, impedance, iterations, residual, flaw = search(line, water, state, velocity, spin, h, mobility)
    return StepResult(converged, new if converged else state, top, impedance, iterations, residual, FLAWS[flaw])


@inlined
def search(line, water, state, velocity, spin, h, mobility):
    """A step by the first of the searches that ends in a configuration of a line; the fields of a StepResult, but a
    number of FLAWS for the flaw."""
    spent, done, flaw = 0, False, 0
    for k in range(len(_SEARCHES)):
        converged, new, top, impedance, iterations, residual = solve_step(
            line, water, state, velocity, spin, h, mobility, _SEARCHES[k], k > 0
        )
        spent += iterations
        flaw = 0
        if converged:
            flaw = 1 if folded(line.length, state.strain, new.strain) else 2 if inverted(new.position, new.quaternion) else 0
        done = converged and flaw == 0
        if done:
            break
    return done, new if done else state, top, impedance, spent, residual, flaw


@kernel
def energy_of(line, state):
    """Energies [J], in the order of state.ENERGIES."""
    return energies(line, state.position, state.quaternion, state.velocity, state.rate, state.added_mass_velocity, state.strain)
