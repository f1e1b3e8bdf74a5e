"""What is told of a scene's coupled static equilibrium."""

from __future__ import annotations

from typing import Any

import numpy as np

from master.scene.reading import Scene
from master.with_units.statics import Prepared, equilibrium, without_noise
from pipe_fmu import Pipe, validity
from vessel_fmu import native


def report(scene: Scene) -> dict[str, Any]:
    """What `pipelay statics --json` prints; forces and moments act on the pipe, in e.

    The touchdown is the arc length at which the centreline, linear between the nodes, last rises through z = -d/8 of the diameter d over
    the coating of the section there; 0 where none lies lower. The lowest point is that of the nodes. Round-off against the norm of its
    vector is 0.
    """
    at = equilibrium(scene)
    pipe, found = Pipe(at.pipe), at.found
    state = pipe.at_rest(found)
    forces = pipe.section_forces(state)
    touchdown = None
    if at.pipe.seabed is not None:
        touchdown = _touchdown(pipe.s, found.position[:, 2], 0.125 * pipe.line.loads.bed.diameter)
    top, foot = without_noise(pipe.spatial(state, forces, -1)), without_noise(-pipe.spatial(state, forces, 0))
    return {
        "top_force_e_N": top[:3].tolist(),
        "top_moment_e_N_m": top[3:].tolist(),
        "foot_force_e_N": foot[:3].tolist(),
        "foot_moment_e_N_m": foot[3:].tolist(),
        "top_tension_N": float(forces.tension[-1]),
        "stretch_m": pipe.stretched_length(state) - at.pipe.length,
        "largest_bending_moment_N_m": float(pipe.largest_bending_moment(forces)),
        "lowest_point_m": float(found.position[:, 2].max()) + 0.0,
        "touchdown_s_m": touchdown,
        "largest_von_mises_Pa": pipe.largest_von_mises(state, forces),
        "utilisation": pipe.utilisation(state, forces) or None,
        "stable": bool(found.stable),
        "vessel_position_m": None if at.vessel is None else without_noise(at.vessel.start.position).tolist(),
        "hold_force_N": None if at.vessel is None else list(at.vessel.hold_force),
        "remarks": remarks(at),
        "s_m": pipe.s.tolist(),
        "position_e_m": without_noise(found.position).tolist(),
        "tension_N": forces.tension.tolist(),
        "bending_moment_N_m": np.hypot(forces.moment[:, 1], forces.moment[:, 2]).tolist(),
        "shear_N": np.hypot(forces.shear[:, 0], forces.shear[:, 1]).tolist(),
    }


def remarks(at: Prepared) -> list[str]:
    """What the units will say of their start, one line each."""
    pipe = Pipe(at.pipe)
    state = pipe.at_rest(at.found)
    used = pipe.utilisation(state, pipe.section_forces(state))
    found = [*validity.of_parameters(at.pipe), *pipe.remarks(state, used)]
    if at.vessel is not None:
        found += native.started(at.vessel)[1]
    return list(dict.fromkeys(found))


def _touchdown(s: np.ndarray, z: np.ndarray, reach: np.ndarray) -> float:
    """Arc length where the depth `z` (n,), linear over `s` (n,), last falls through -`reach` (n - 1,) of its element; 0 if nowhere."""
    lower, upper = z[:-1] + reach, z[1:] + reach
    lying = np.flatnonzero((lower > 0.0) | (upper > 0.0))
    if not lying.size:
        return 0.0
    e = int(lying[-1])
    part = lower[e] / (lower[e] - upper[e]) if upper[e] <= 0.0 else 1.0
    return float(s[e] + part * (s[e + 1] - s[e]))
