"""The pipe's constants and its state as plain vectors, and back: the order of what lies in them, once.

Constants: HEAD counts, the numbers of a unit, then the arrays of its mesh, line, sea, walls and limits. State: numbers, then the arrays of
a PipeState. Kernels take slices, and copy nothing.
"""

from typing import NamedTuple

import numpy as np

from .arrays import Array
from .compiled import kernel
from .line import Line, Sea
from .loads import Loads
from .loads.bed import Bed
from .results.section_forces import MassPerLength
from .results.wall_stress import Wall
from .step.state import WORKS, PipeState
from .validity import QUIET, Limits

NODES, LEVELS, ADDED_MASS, BED, DAMPING, YIELDS, PARTS = range(7)  # counts, and what there is, at the head of the constants
HEAD = 7
N_WORKS, KINDS = len(WORKS), len(QUIET)


class Unit(NamedTuple):
    """All constants of a pipe unit."""

    s: Array  # (n,) arc lengths of the nodes [m]
    line: Line
    mass: MassPerLength
    sea: Sea
    walls: Wall  # at the nodes, below joints
    element_walls: Wall
    limits: Limits
    reference: Array  # (6,) force and moment from which force_change and moment_change count
    parts: int  # of a step that does not converge, at most
    yields: bool  # whether a section has a yield stress


class Now(NamedTuple):
    """A unit's state: the pipe's, and what the last step left behind."""

    pipe: PipeState
    top: Array  # (6,) mean force and moment on the pipe at its top over the last step
    impedance: Array  # (6, 6)
    iterations: float
    residual: float
    told: Array  # (KINDS,) what was remarked, see validity.look


def packed(unit: Unit) -> Array:
    """Constants as one vector."""
    line, wall = unit.line, unit.element_walls
    n, k = len(unit.s), len(unit.sea.levels)
    head = [n, k, len(line.added_mass) > 0, len(line.loads.bed.bearing) > 0, len(line.damping) > 0, unit.yields, unit.parts]
    bed, limits = line.loads.bed, unit.limits
    numbers = [
        line.foot_clamped, line.top_clamped, line.numerical_damping, bed.damping, bed.friction, bed.friction_speed,
        unit.sea.start, unit.sea.ramp, unit.sea.period, unit.sea.drag, wall.water, wall.depth,
        limits.deepest, limits.surface, limits.highest, limits.no_pull,
    ]  # fmt: skip
    arrays = [
        unit.reference, unit.s, line.length, line.stiffness, line.share, line.loads.weight, line.loads.drag, bed.bearing, bed.diameter,
        line.mass, line.offset, line.inertia, line.spin_damping, line.added_mass, line.damping, *unit.mass, unit.sea.levels,
        unit.sea.velocities, *_wall(unit.walls), *_wall(wall), limits.radius, limits.bearable,
    ]  # fmt: skip
    return np.concatenate([np.array([*head, *numbers], dtype=float), *(np.ravel(array) for array in arrays)])


def _wall(wall: Wall) -> list[Array]:
    return [wall.area, wall.second_moment, wall.inner, wall.outer, wall.displaced, wall.contents, wall.yield_stress]


@kernel
def _row(vector, at, n):
    """`n` numbers, and the place behind them."""
    return vector[at : at + n], at + n


@kernel
def _table(vector, at, n, columns):
    """`n` rows, and the place behind them."""
    return vector[at : at + n * columns].reshape((n, columns)), at + n * columns


@kernel
def _walls_from(vector, at, n, water, depth):
    area, at = _row(vector, at, n)
    second_moment, at = _row(vector, at, n)
    inner, at = _row(vector, at, n)
    outer, at = _row(vector, at, n)
    displaced, at = _row(vector, at, n)
    contents, at = _row(vector, at, n)
    yield_stress, at = _row(vector, at, n)
    return Wall(area, second_moment, inner, outer, displaced, contents, water, depth, yield_stress), at


@kernel
def unpacked(c):
    """The Unit of a vector of constants."""
    n, k = int(c[NODES]), int(c[LEVELS])
    e, lying = n - 1, n - 1 if c[BED] != 0.0 else 0
    numbers = c[HEAD : HEAD + 16]
    at = HEAD + 16
    reference, at = _row(c, at, 6)
    s, at = _row(c, at, n)
    length, at = _row(c, at, e)
    stiffness, at = _table(c, at, e, 6)
    share, at = _table(c, at, e, 2)
    weight, at = _row(c, at, e)
    drag, at = _table(c, at, e, 2)
    bearing, at = _row(c, at, lying)
    diameter, at = _row(c, at, lying)
    mass, at = _row(c, at, n)
    offset, at = _row(c, at, n)
    inertia, at = _table(c, at, n, 3)
    spin_damping, at = _table(c, at, n, 3)
    added_mass, at = _table(c, at, n if c[ADDED_MASS] != 0.0 else 0, 3)
    damping, at = _row(c, at, e if c[DAMPING] != 0.0 else 0)
    along, at = _row(c, at, e)
    across, at = _row(c, at, e)
    levels, at = _row(c, at, k)
    velocities, at = _table(c, at, k, 3)
    walls, at = _walls_from(c, at, n, numbers[10], numbers[11])
    element_walls, at = _walls_from(c, at, e, numbers[10], numbers[11])
    radius, at = _row(c, at, e)
    bearable, at = _row(c, at, e)
    loads = Loads(weight, drag, Bed(bearing, diameter, numbers[3], numbers[4], numbers[5]))
    ends = numbers[0] != 0.0, numbers[1] != 0.0
    line = Line(length, stiffness, share, loads, mass, offset, inertia, spin_damping, added_mass, damping, ends[0], ends[1], numbers[2])
    sea = Sea(levels, velocities, numbers[6], numbers[7], numbers[8], numbers[9] != 0.0)
    limits = Limits(numbers[12], numbers[13], numbers[14], numbers[15], radius, bearable)
    return Unit(
        s, line, MassPerLength(along, across), sea, walls, element_walls, limits, reference, int(c[PARTS]), c[YIELDS] != 0.0
    )


def state_size(n: int, added_mass: bool) -> int:
    """Numbers in the state of a unit of n nodes."""
    return 4 + KINDS + 42 + N_WORKS + (3 + 4 + 3 + 3 + 18 + (3 if added_mass else 0)) * n + (7 + 4) * (n - 1)


@kernel
def store(pipe, top, impedance, iterations, residual, told, out):
    """Fill a state's vector."""
    out[0], out[1], out[2], out[3] = pipe.time, pipe.top_work, float(iterations), residual
    at = _keep(told, out, 4)
    at = _keep(top, out, at)
    at = _keep_table(impedance, out, at)
    at = _keep(pipe.works, out, at)
    at = _keep_table(pipe.position, out, at)
    at = _keep_table(pipe.quaternion, out, at)
    at = _keep_table(pipe.velocity, out, at)
    at = _keep_table(pipe.rate, out, at)
    at = _keep_table(pipe.last, out, at)
    at = _keep_table(pipe.before, out, at)
    at = _keep_table(pipe.earlier, out, at)
    at = _keep_table(pipe.added_mass_velocity, out, at)
    at = _keep_table(pipe.strain, out, at)
    _keep_table(pipe.chord, out, at)


@kernel
def _keep(row, out, at):
    for i in range(row.shape[0]):
        out[at + i] = row[i]
    return at + row.shape[0]


@kernel
def _keep_table(table, out, at):
    for i in range(table.shape[0]):
        for j in range(table.shape[1]):
            out[at] = table[i, j]
            at += 1
    return at


@kernel
def loaded(vector, n, added_mass):
    """The Now of a state's vector, of n nodes."""
    told, at = _row(vector, 4, KINDS)
    top, at = _row(vector, at, 6)
    impedance, at = _table(vector, at, 6, 6)
    works, at = _row(vector, at, N_WORKS)
    position, at = _table(vector, at, n, 3)
    quaternion, at = _table(vector, at, n, 4)
    velocity, at = _table(vector, at, n, 3)
    rate, at = _table(vector, at, n, 3)
    last, at = _table(vector, at, n, 6)
    before, at = _table(vector, at, n, 6)
    earlier, at = _table(vector, at, n, 6)
    added, at = _table(vector, at, n if added_mass else 0, 3)
    strain, at = _table(vector, at, n - 1, 7)
    chord, at = _table(vector, at, n - 1, 4)
    pipe = PipeState(
        vector[0], position, quaternion, velocity, rate, added, strain, chord, last, before, earlier, vector[1], works
    )
    return Now(pipe, top, impedance, vector[2], vector[3], told)
