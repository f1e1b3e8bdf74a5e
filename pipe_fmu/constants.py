"""The constants of a pipe unit (vectors.py) from its parameters' numbers (values.py), by one kernel for Python and FMUs in machine code."""

import math

import numpy as np

from . import section as sections
from . import vectors
from .arrays import Array
from .compiled import kernel
from .line import shear_stiffness
from .loads import fill_loads
from .parameters import PipeParameters
from .results.wall_stress import Wall, fill_wall
from .rules import WORDS, refusal
from .section import bearing, shape_of, weight_in_water
from .validity import NO_STRAIN, SURFACE, bearable
from .values import N_GLOBAL, N_SECTION, place, values
from .vectors import constants_size, unpacked

_ANEW = "such an FMU must be exported anew"
_PORTS = ("internal", "numerical")
REFUSALS = (  # words of `refused`
    f"section.{sections.THICK}",
    *(words for words, _ in WORDS),
    *(f"{kind}_damping: {verb} the output {kind}_dissipation; {_ANEW}" for kind in _PORTS for verb in ("adds", "changes")),
)
_COUNTS = (2, *(count for _, count in WORDS))
_RULED, _PORT = 1, 1 + len(WORDS)  # the first of a kind
_refusal = kernel(refusal)
_shape, _weight, _bearing = kernel(shape_of), kernel(weight_in_water), kernel(bearing)
_AT_JOINT = 1e-9  # m; so near to the end of a section a node stands at its joint
TOP, ATTITUDE, TOP_RANGE, SUBSTEPS = place("top_position"), place("top_quaternion"), place("top_range"), place("max_substeps")
INTERNAL, NUMERICAL = place("internal_damping"), place("numerical_damping")
_FORCE, _MOMENT, _ADDED = place("reference_force"), place("reference_moment"), place("added_mass.coefficient")
_BED, REFERENCE = place("seabed.damping"), place("seabed.reference_weight")
_DEPTH, _DENSITY, _GRAVITY = (place(f"environment.{name}") for name in ("depth", "water_density", "gravity"))
_FLOW, _TIMES = place("environment.current.velocity"), place("environment.current.start")


def constants_on(parameters: PipeParameters, s: Array) -> Array:
    """Constants of a unit with its nodes at `s` (n,) [m]."""
    n, current = len(s), parameters.environment.current
    depths, factors = ((), ()) if current is None else current.shape(math.nan)
    there = parameters.seabed is not None, parameters.added_mass is not None, parameters.internal_damping > 0.0
    c = np.zeros(constants_size(n, len(depths), *there))
    c[vectors.NODES], c[vectors.LEVELS] = n, len(depths)
    c[vectors.BED], c[vectors.ADDED_MASS], c[vectors.DAMPING] = there
    c[vectors.FOOT_CLAMPED], c[vectors.TOP_CLAMPED] = parameters.foot == "clamped", parameters.top == "clamped"
    unit = unpacked(c)
    unit.s[:] = s
    unit.fixed.section[:] = sections_at(parameters, 0.5 * (s[1:] + s[:-1]))
    unit.fixed.node_section[:] = sections_at(parameters, s - _AT_JOINT)
    unit.fixed.depths[:], unit.fixed.factors[:] = depths, factors
    fill_constants(values(parameters), c)
    return c


def sections_at(parameters: PipeParameters, x: Array) -> Array:
    """Numbers of the sections that the arc lengths `x` lie in."""
    ends = np.cumsum([section.length or parameters.length for section in parameters.all_sections])
    return np.minimum(np.searchsorted(ends, x), len(ends) - 1).astype(float)


def walls(parameters: PipeParameters, s: Array) -> tuple[Wall, Wall]:
    """Walls below and above the nodes `s` (n,): two at a joint of sections, elsewhere the same."""
    sea = parameters.environment
    pressures = float(sea.water_density * sea.gravity), float(sea.depth)
    out = []
    for side in (-_AT_JOINT, _AT_JOINT):
        wall = Wall._make([*np.empty((6, len(s))), *pressures, np.empty(len(s))])
        fill_walls(values(parameters), sections_at(parameters, s + side), wall)
        out.append(wall)
    return out[0], out[1]


@kernel
def fill_walls(given, which, wall):
    """Fill in the walls at places in the sections `which`."""
    for i in range(which.shape[0]):
        row = row_of(given, which[i])
        contents = row[sections.CONTENTS] * given[_GRAVITY]
        fill_wall(wall, i, _shape(row), row[sections.WALL], contents, row[sections.YIELD])


@kernel
def row_of(given, number):
    """The numbers of a section."""
    first = N_GLOBAL + N_SECTION * int(number)
    return given[first : first + N_SECTION]


@kernel
def weights(given):
    """Submerged weights per length (m,) [N/m] of the sections, and of these the least and the most."""
    out = np.empty((given.shape[0] - N_GLOBAL) // N_SECTION)
    least, most = math.inf, -math.inf
    for i in range(out.shape[0]):
        shape = _shape(row_of(given, i))
        out[i] = _weight(shape.mass, shape.outer_area, given[_DENSITY], given[_GRAVITY])
        least, most = min(least, out[i]), max(most, out[i])
    return out, least, most


@kernel
def fill_constants(given, c):
    """Fill in what follows from the values `given` in constants whose counts, nodes and fixed parts are there."""
    unit = unpacked(c)
    line, fixed, mass = unit.line, unit.fixed, unit.mass
    _fill_numbers(given, c)
    for i in range(3):
        unit.top[i], unit.reference[i], unit.reference[3 + i] = given[TOP + i], given[_FORCE + i], given[_MOMENT + i]
    for i in range(4):
        unit.top[3 + i] = given[ATTITUDE + i]
    _fill_sea(given, unit)
    own, least, most = weights(given)
    added = 0.0 if math.isnan(given[_ADDED]) else given[_ADDED] * given[_DENSITY]
    deepest, stiffest = 0.0, 0.0
    for e in range(line.length.shape[0]):
        number = int(fixed.section[e])
        row = row_of(given, number)
        shape = _shape(row)
        h = unit.s[e + 1] - unit.s[e]
        line.length[e] = h
        axial, shear, torsion, bending, bending_3 = shape.stiffness
        k2, p2 = shear_stiffness(shear, bending_3, h)
        k3, p3 = shear_stiffness(shear, bending, h)
        _put(line.stiffness[e], (axial, k2, k3, torsion, bending, bending_3))
        _put(line.share[e], (p2, p3))
        weight = _bearing(own[number], most, least, given[REFERENCE])
        drag = row[sections.DRAG_TANGENTIAL], row[sections.DRAG_NORMAL]
        fill_loads(line.loads, e, own[number], weight, shape.diameter, given[_DENSITY], *drag)
        mass.along[e] = shape.mass
        mass.across[e] = shape.mass + added * shape.outer_area
        unit.limits.radius[e] = 0.0 if math.isnan(row[sections.WALL]) else shape.outer
        unit.limits.bearable[e] = bearable(row[sections.WALL], row[sections.MODULUS], row[sections.YIELD])
        if line.damping.shape[0] > 0:
            line.damping[e] = given[INTERNAL]
        if row[sections.DRAG_NORMAL] > 0.0 or row[sections.DRAG_TANGENTIAL] > 0.0:
            c[vectors.DRAG] = 1.0
        if not math.isnan(row[sections.YIELD]):
            c[vectors.YIELDS] = 1.0
        deepest, stiffest = max(deepest, 0.5 * shape.diameter), max(stiffest, axial)
    c[vectors.DEEPEST] = math.inf if c[vectors.BED] != 0.0 else deepest
    c[vectors.NO_PULL] = NO_STRAIN * stiffest
    _lump(given, unit, added)
    fill_walls(given, fixed.node_section, unit.walls)
    fill_walls(given, fixed.section, unit.element_walls)


@kernel
def refused(given, exported):
    """Number of the words that refuse the values `given`, -1 if none do, the numbers in them, and how many there are."""
    unit = unpacked(exported)
    for i in range((given.shape[0] - N_GLOBAL) // N_SECTION):
        row = row_of(given, i)
        radius = 0.5 * row[sections.DIAMETER]
        if row[sections.WALL] > radius:
            return 0, (row[sections.WALL], radius, 0.0, 0.0), _COUNTS[0]
    _, least, most = weights(given)
    heaviest = 1.0 if exported[vectors.BED] == 0.0 else _bearing(most, most, least, given[REFERENCE])
    pose = given[TOP : TOP + 3], given[ATTITUDE : ATTITUDE + 4]
    number, numbers = _refusal(unit.s[-1], *pose, given[TOP_RANGE], given[SUBSTEPS], heaviest)
    if number >= 0:
        return _RULED + number, numbers, _COUNTS[_RULED + number]
    there = unit.line.damping.shape[0] > 0, unit.line.numerical_damping > 0.0
    wanted = given[INTERNAL] > 0.0, given[NUMERICAL] > 0.0
    for i in range(2):
        if there[i] != wanted[i]:
            return _PORT + 2 * i + (1 if there[i] else 0), (0.0, 0.0, 0.0, 0.0), 0
    return -1, (0.0, 0.0, 0.0, 0.0), 0


@kernel
def _put(row, numbers):
    for i in range(len(numbers)):
        row[i] = numbers[i]


@kernel
def _fill_numbers(given, c):
    """Fill in those of the numbers that no section has to do with."""
    depth = given[_DEPTH]
    c[vectors.PARTS], c[vectors.NUMERICAL_DAMPING] = given[SUBSTEPS], given[NUMERICAL]
    c[vectors.DRAG], c[vectors.YIELDS] = 0.0, 0.0
    for i in range(3):
        c[vectors.BED_DAMPING + i] = given[_BED + i] if c[vectors.BED] != 0.0 else (1.0 if i == 2 else 0.0)
        c[vectors.CURRENT_START + i] = given[_TIMES + i] if c[vectors.LEVELS] > 0.0 else 0.0
    c[vectors.WATER], c[vectors.DEPTH] = given[_DENSITY] * given[_GRAVITY], depth
    c[vectors.SURFACE], c[vectors.HIGHEST] = -depth, SURFACE * depth


@kernel
def _fill_sea(given, unit):
    """Fill in the current's levels, from the surface down, and its velocities there."""
    for k in range(unit.sea.levels.shape[0]):
        below = unit.fixed.depths[k]
        unit.sea.levels[k] = 0.0 if math.isnan(below) else below - given[_DEPTH]
        for i in range(3):
            unit.sea.velocities[k, i] = unit.fixed.factors[k] * given[_FLOW + i]


@kernel
def _lump(given, unit, added):
    """Lump masses, inertia and damping, half of every element to each end.

    The centre of a lumped mass is ahead of its node by the couples m h^2 / 12 of both elements over the mass m h / 2 of both.
    """
    line = unit.line
    for i in range(unit.s.shape[0]):
        line.mass[i], couple, share = 0.0, 0.0, 0.0
        line.inertia[i, :], line.spin_damping[i, :] = 0.0, 0.0
        if line.added_mass.shape[0] > 0:
            line.added_mass[i, :] = 0.0
        for e in range(max(i - 1, 0), min(i + 1, line.length.shape[0])):
            row = row_of(given, unit.fixed.section[e])
            shape, h = _shape(row), line.length[e]
            m = unit.mass.across[e]
            couple += (m if e == i else -m) * h * h / 12.0
            share += 0.5 * m * h
            line.mass[i] += 0.5 * h * shape.mass
            for k in range(3):
                line.inertia[i, k] += 0.5 * h * shape.inertia[k]
                line.spin_damping[i, k] += 0.5 * h * row[sections.ROTATIONAL_DAMPING + k]
                if k > 0 and line.added_mass.shape[0] > 0:
                    line.added_mass[i, k] += 0.5 * h * added * shape.outer_area
        line.offset[i] = couple / share
