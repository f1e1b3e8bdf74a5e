"""The pipe's constants and its state as plain vectors, and back: the order of what lies in them, once.

Constants: HEAD counts, the time-independent numbers of a unit, then the arrays of the mesh, line, sea, walls and limits, and what of the
parameters stays as it is (constants.py fills them). State: numbers, then the arrays of a PipeState. Kernels take slices, and copy nothing.
"""

from typing import NamedTuple

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
(
    FOOT_CLAMPED, TOP_CLAMPED, NUMERICAL_DAMPING, BED_DAMPING, FRICTION, FRICTION_SPEED, CURRENT_START, RAMP, PERIOD, DRAG, WATER, DEPTH,
    DEEPEST, SURFACE, HIGHEST, NO_PULL,
) = range(HEAD, HEAD + 16)  # fmt: skip
_ARRAYS = HEAD + 16
N_WORKS, KINDS = len(WORKS), len(QUIET)


class Fixed(NamedTuple):
    """What no change of parameters changes."""

    section: Array  # (n - 1,) number of the section that an element's middle lies in
    node_section: Array  # (n,) and of that below a node
    depths: Array  # (k,) of the current's levels below the surface [m], NaN at the bed
    factors: Array  # (k,) of the current there


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
    top: Array  # (7,) position and attitude of the top at the start; the attitude all zero: as it hangs
    fixed: Fixed


class Now(NamedTuple):
    """A unit's state: the pipe's, and what the last step left behind."""

    pipe: PipeState
    top: Array  # (6,) mean force and moment on the pipe at its top over the last step
    impedance: Array  # (6, 6)
    iterations: float
    residual: float
    told: Array  # (KINDS,) what was remarked, see validity.look


def constants_size(n: int, k: int, bed: bool, added_mass: bool, damping: bool) -> int:
    """Numbers in the constants of a unit of n nodes, k levels of the current, and what else there is."""
    optional = (2 * (n - 1) if bed else 0) + (3 * n if added_mass else 0) + (n - 1 if damping else 0)
    return _ARRAYS + 13 + 17 * n + 24 * (n - 1) + 6 * k + optional


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
    at = _ARRAYS
    reference, at = _row(c, at, 6)
    top, at = _row(c, at, 7)
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
    walls, at = _walls_from(c, at, n, c[WATER], c[DEPTH])
    element_walls, at = _walls_from(c, at, e, c[WATER], c[DEPTH])
    radius, at = _row(c, at, e)
    bearable, at = _row(c, at, e)
    section, at = _row(c, at, e)
    node_section, at = _row(c, at, n)
    depths, at = _row(c, at, k)
    factors, at = _row(c, at, k)
    loads = Loads(weight, drag, Bed(bearing, diameter, c[BED_DAMPING], c[FRICTION], c[FRICTION_SPEED]))
    ends = c[FOOT_CLAMPED] != 0.0, c[TOP_CLAMPED] != 0.0
    line = Line(length, stiffness, share, loads, mass, offset, inertia, spin_damping, added_mass, damping, *ends, c[NUMERICAL_DAMPING])
    sea = Sea(levels, velocities, c[CURRENT_START], c[RAMP], c[PERIOD], c[DRAG] != 0.0)
    limits = Limits(c[DEEPEST], c[SURFACE], c[HIGHEST], c[NO_PULL], radius, bearable)
    fixed = Fixed(section, node_section, depths, factors)
    return Unit(
        s, line, MassPerLength(along, across), sea, walls, element_walls, limits, reference, int(c[PARTS]), c[YIELDS] != 0.0, top, fixed
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
    pipe = PipeState(vector[0], position, quaternion, velocity, rate, added, strain, chord, last, before, earlier, vector[1], works)
    return Now(pipe, top, impedance, vector[2], vector[3], told)
