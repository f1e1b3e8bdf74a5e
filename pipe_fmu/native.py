"""The unit as kernels on plain vectors: what the Python unit (slave.py) calls, and what an FMU in machine code is made of.

Constants and state: vectors.py. Inputs: velocity (3,), angular velocity (3,), mobility (36,). Outputs: `output_places`, computed in groups.
"""

import math

import numpy as np

from . import validity
from .compiled import kernel
from .constants import REFUSALS, fill_constants, refused
from .follow import alike, flows, follow, freeze, newton
from .line import water_at
from .maths.so3 import apply
from .model import constants as constants
from .notes import DISCARD, ERROR, WARNING, note
from .parameters import PipeParameters
from .results.end_forces import matrix_at
from .results.section_forces import SectionForces, centreline_length, largest_bending_square, nodal_wrenches
from .results.wall_stress import fill_wall_tension, largest_stress
from .step.integrator import FLAWS, energy_of, rest
from .step.state import ENERGIES, WORK_PORTS, timed
from .substeps import divide
from .values import value_places as value_places
from .values import values as values
from .vectors import KINDS, loaded, store, unpacked

MESSAGES = (
    *validity.WORDS,
    "step of %g s at t = %g s: no convergence after %d corrections, residual %.2e of the largest element force",
    "step of %g s at t = %g s: no convergence after %d corrections, nor in sub-steps of %g s, residual %.2e of the largest element force",
    f"step of %g s at t = %g s: an element would be {FLAWS[1]}; more nodes may help",
    f"step of %g s at t = %g s, nor in sub-steps of %g s: an element would be {FLAWS[1]}; more nodes may help",
    f"step of %g s at t = %g s: an element would be {FLAWS[2]}; more nodes may help",
    f"step of %g s at t = %g s, nor in sub-steps of %g s: an element would be {FLAWS[2]}; more nodes may help",
    "step of %g s at t = %g s: done in %d sub-steps of %g s or more, %d corrections; pose and work of the top are exact, but its velocity "
    "jumps at both ends of the step instead of being smooth",
    *REFUSALS,
    "statics: the equilibrium is not stable; the line will leave it at the least push",
    "statics: no equilibrium was found on the way from the exported one; export the FMU anew with these values",
)
_REFUSED, _UNSTABLE, _ASTRAY = len(validity.WORDS) + 7, len(MESSAGES) - 2, len(MESSAGES) - 1
UNSTABLE = MESSAGES[_UNSTABLE]
_NOTHING = (0.0, 0.0, 0.0, 0.0)
_LOST, _FLAWED, _DIVIDED = len(validity.WORDS), len(validity.WORDS) + 2, len(validity.WORDS) + 6
DIRECT, STORED, RECOVERED = range(3)  # groups of outputs: what the state holds, its energies, and what is recovered from equilibrium
N_GROUPS, N_INPUTS = 3, 42
ALWAYS = np.inf  # a step of any length is tried whole


def _sizes(n: int) -> tuple[dict[str, int], ...]:
    direct = {
        "force": 3, "moment": 3, "force_change": 3, "moment_change": 3, "top_velocity": 3, "top_angular_velocity": 3, "top_position": 3,
        "top_quaternion": 4, "impedance": 36, "newton_iterations": 1, "newton_residual": 1, "top_work": 1, **dict.fromkeys(WORK_PORTS, 1),
        "pipe_length": 1, "s": n, "node_position": 3 * n,
    }  # fmt: skip
    recovered = {
        "end_force": 3, "end_moment": 3, "largest_tension": 1, "largest_bending_moment": 1, "largest_von_mises": 1,
        "largest_utilisation": 1, "node_tension": n, "node_wall_tension": n, "node_moment": 3 * n, "node_shear": 2 * n,
    }  # fmt: skip
    return direct, dict.fromkeys(ENERGIES, 1), recovered


_DIRECT = sum(_sizes(0)[0].values())  # numbers of that group beside those at the nodes


def output_places(parameters: PipeParameters) -> dict[str, tuple[slice, int]]:
    """Where in the outputs a port's values lie, and the group they belong to; the nodes of the parameters are placed."""
    places, at, n = {}, 0, len(parameters.nodes_at)
    for group, sizes in enumerate(_sizes(n)):
        for port, size in sizes.items():
            places[port] = slice(at, at + size), group
            at += size
    return places


@kernel
def _put(row, factor, out, at):
    for i in range(row.shape[0]):
        out[at + i] = factor * row[i]
    return at + row.shape[0]


@kernel
def unit_outputs(constants, state, group, out):
    """Fill the places in `out` of one group of outputs."""
    unit = unpacked(constants)
    n = unit.s.shape[0]
    now = loaded(state, n, unit.line.added_mass.shape[0] > 0)
    pipe = now.pipe
    first = _DIRECT + 4 * n
    if group == DIRECT:
        _direct(unit, now, out)
    elif group == STORED:
        at = first
        for energy in energy_of(unit.line, pipe):
            out[at] = energy
            at += 1
    else:
        _recovered(unit, pipe, out, first + len(ENERGIES))


@kernel
def _direct(unit, now, out):
    pipe, top = now.pipe, now.top
    at = _put(top, -1.0, out, 0)  # eq. (69)
    for i in range(6):
        out[at + i] = -top[i] - unit.reference[i]
    at = _put(pipe.last[-1], 1.0, out, at + 6)
    at = _put(pipe.position[-1], 1.0, out, at)
    at = _put(pipe.quaternion[-1], 1.0, out, at)
    at = _put(now.impedance.reshape(36), 1.0, out, at)
    out[at], out[at + 1], out[at + 2] = now.iterations, now.residual, pipe.top_work
    at = _put(pipe.works, 1.0, out, at + 3)
    out[at] = centreline_length(unit.line.length, pipe.strain)
    at = _put(unit.s, 1.0, out, at + 1)
    _put(pipe.position.reshape(pipe.position.size), 1.0, out, at)


@kernel
def _forces(unit, pipe):
    """Section forces at the nodes, material components."""
    water = water_at(unit.sea, pipe.time)
    motion = pipe.velocity, pipe.rate, pipe.strain
    wrenches = nodal_wrenches(unit.line, unit.mass, water, pipe.position, pipe.quaternion, *motion)
    return SectionForces(wrenches[:, 0].copy(), wrenches[:, 1:3].copy(), wrenches[:, 3:].copy())


@kernel
def _recovered(unit, pipe, out, at):
    forces = _forces(unit, pipe)
    tension, shear, moment = forces.tension, forces.shear, forces.moment
    r = matrix_at(pipe.quaternion, unit.s.shape[0] - 1)
    force = apply(r, (tension[-1], shear[-1, 0], shear[-1, 1]))
    couple = apply(r, (moment[-1, 0], moment[-1, 1], moment[-1, 2]))
    for i in range(3):
        out[at + i], out[at + 3 + i] = -force[i], -couple[i]
    stress, used = largest_stress(unit.element_walls, unit.s, pipe.position, forces)
    out[at + 6], out[at + 7] = tension.max(), math.sqrt(largest_bending_square(unit.s, moment, shear))
    out[at + 8], out[at + 9] = stress, used
    at = _put(tension, 1.0, out, at + 10)
    fill_wall_tension(unit.walls, pipe.position, tension, out[at : at + tension.shape[0]])
    at = _put(moment.reshape(moment.size), 1.0, out, at + tension.shape[0])
    _put(shear.reshape(shear.size), 1.0, out, at)


@kernel
def look(unit, pipe, told, notes):
    """Note what is beyond its limit in a state, and remember it in `told`."""
    used = 0.0
    if unit.yields:
        _, used = largest_stress(unit.element_walls, unit.s, pipe.position, _forces(unit, pipe))
    validity.look(unit.s, unit.line.stiffness, unit.limits, pipe.position, pipe.strain, used, told, 0, notes)


@kernel
def unit_step(constants, inputs, time, h, state, after, notes):
    """Advance from `time` by h [s]: 0 and the state `after`; or DISCARD and a note where Newton's method does not converge, nor in
    sub-steps if allowed. Warnings are noted.

    A top that yields gets no sub-steps: each part would have a velocity of its own, and the work would not be that of the means.
    """
    notes[0] = 0.0
    unit = unpacked(constants)
    now = loaded(state, unit.s.shape[0], unit.line.added_mass.shape[0] > 0)
    mobility = inputs[6:42].reshape((6, 6))
    most = unit.parts
    for i in range(6):
        for j in range(6):
            if mobility[i, j] != 0.0:
                most = 1
    start = timed(now.pipe, time)
    result = divide(unit.line, unit.sea, start, inputs[:3], inputs[3:6], h, mobility, most, ALWAYS)
    done, pipe, top, impedance, iterations, residual, flaw, parts, shortest = result
    if not done:
        if flaw > 0:
            first = _FLAWED + 2 * (flaw - 1)
            if most > 1:
                note(notes, DISCARD, first + 1, (h, time, h / most))
            else:
                note(notes, DISCARD, first, (h, time))
        elif most > 1:
            note(notes, DISCARD, _LOST + 1, (h, time, float(iterations), h / most, residual))
        else:
            note(notes, DISCARD, _LOST, (h, time, float(iterations), residual))
        return DISCARD
    told = now.told.copy()
    look(unit, pipe, told, notes)
    if parts > 1:
        note(notes, WARNING, _DIVIDED, (h, time, float(parts), shortest, float(iterations)))
    store(pipe, top, impedance, iterations, residual, told, after)
    return 0


@kernel
def _begin(notes, status, template, values, count):
    """Make the first note, with so many of four values."""
    note(notes, status, template, values)
    notes[3] = float(count)


@kernel
def unit_constants(exported, values, constants, notes):
    """Fill `constants` with those of the parameters' `values`; 0, or ERROR and a note where these break a rule."""
    notes[0] = 0.0
    for i in range(constants.shape[0]):
        constants[i] = exported[i]
    number, numbers, count = refused(values, exported)
    if number >= 0:
        _begin(notes, ERROR, _REFUSED + number, numbers, count)
        return ERROR
    fill_constants(values, constants)
    return 0


@kernel
def unit_start(constants, exported, exported_state, inputs, time, state, notes):
    """Fill `state` with that of rest at `time` [s]: 0 and remarks, or ERROR and a note where no equilibrium is found.

    It is the exported state where nothing is changed that bears on the equilibrium; else the equilibrium is followed from there.
    """
    notes[0] = 0.0
    unit = unpacked(constants)
    now = loaded(exported_state, unit.s.shape[0], unit.line.added_mass.shape[0] > 0)
    start, end = exported.copy(), constants.copy()
    freeze(start, exported_state[0])
    freeze(end, time)
    position, quaternion = now.pipe.position.copy(), now.pipe.quaternion.copy()
    top, stiffness, residual, told = now.top, now.impedance, now.residual, np.zeros(KINDS)
    stable = newton(start, np.zeros(3), position, quaternion, 1.0).stable
    if not alike(start, end):
        found, arrived = follow(start, end, top[3:], position, quaternion, stable)
        if not arrived:
            _begin(notes, ERROR, _ASTRAY, _NOTHING, 0)
            return ERROR
        top, stiffness, residual, stable = found.top, found.stiffness, found.residual, found.stable
    pipe = rest(unit.line, position, quaternion, time)
    if not stable and not flows(end):  # in a current this is not known
        _begin(notes, WARNING, _UNSTABLE, _NOTHING, 0)
    look(unit, pipe, told, notes)
    store(pipe, top, stiffness, int(now.iterations), residual, told, state)
    return 0
