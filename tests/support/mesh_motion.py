"""How well a mesh serves a line in motion: histories on it, and their distance from those on a finer one."""

from dataclasses import dataclass, replace

import numpy as np
from pipe_helpers import march, started
from scipy.interpolate import CubicHermiteSpline, CubicSpline
from scipy.spatial.transform import Rotation

STEP, DURATION, EVERY = 0.1, 48.0, 5  # s, s, steps between the instants compared
QUARTERS = np.linspace(0.1, 0.9, 9)  # of the length, where positions are compared


@dataclass(frozen=True)
class History:
    """Nodes `s` (n,), and at k instants: positions (k, 9, 3), top forces (k, 3), bending moments at the nodes (k, n, 2) [N m]."""

    s: np.ndarray
    position: np.ndarray
    top: np.ndarray
    bending: np.ndarray


def history(moving, **mesh):
    """History of a moving line on the mesh that the changed parameters give."""
    pipe, _, state = started(replace(moving.parameters, **mesh))
    states, results = march(pipe, state, moving.motion, STEP, round(DURATION / STEP))
    kept, length = states[EVERY:-1:EVERY], pipe.s[-1]
    forces = np.array([result.top[:3] for result in results])
    return History(
        pipe.s,
        np.array([_positions(pipe.s, one, QUARTERS * length) for one in kept]),
        0.5 * (forces[EVERY - 1 : -1 : EVERY] + forces[EVERY::EVERY])[: len(kept)],
        np.array([pipe.section_forces(one).moment[:, 1:] for one in kept]),
    )


def _positions(s, state, at):
    first = Rotation.from_quat(np.roll(state.quaternion, -1, axis=1)).apply([1.0, 0.0, 0.0])
    return CubicHermiteSpline(s, state.position, first)(at)


def distance(found, right):
    """Root mean squares over time of the errors in position [m], in top force [N] and in the bending moment along the line [N m]."""
    moment = found.bending - CubicSpline(right.s, right.bending, axis=1)(found.s)
    along = np.trapezoid(np.sum(moment**2, axis=2), found.s, axis=1) / found.s[-1]
    return np.array([_rms(found.position - right.position), _rms(found.top - right.top), np.sqrt(np.mean(along))])


def _rms(error):
    return np.sqrt(np.mean(np.sum(error**2, axis=-1)))
