"""From parameters to the discretised line."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from . import mesh
from .arrays import Array
from .element.strains import ROWS
from .line import Line, Water, shear_stiffness
from .loads import loads_of
from .parameters import PipeParameters, Section
from .results import section_forces
from .statics import catenary
from .statics.solve import solve
from .step.system import element_strains

_PROBE = (4, 8)  # elements of the probing mesh for one of the mesh to be made; the finer where the other finds no equilibrium,
_PROBE_LIMIT = 2000  # as long as there are fewer than these
_TRIES = (12, 16, 24, 32, 47, 64, 96, 128, 192, 256, 384, 512, 768, 1024)  # elements tried for a tolerance
_PARTS = (2, 10)  # of an element, in the meshes that a tolerance is measured against: the first tells soon, the second for certain
_MARGIN = 0.9  # of the tolerance, which the error of the finer mesh may use up


def resolve(parameters: PipeParameters) -> PipeParameters:
    """The parameters with their nodes placed (`nodes_at`): as the mesh's kind says, or as few as the tolerance allows.

    Raises ValueError where the sections need more nodes, or where no mesh keeps the tolerance.
    """
    if parameters.nodes_at:
        return parameters
    count = parameters.nodes - 1
    if parameters.tolerance is None:
        return _placed(parameters, _mesh(parameters, count))
    for count in _TRIES:
        if count < len(parameters.all_sections):
            continue
        s = _mesh(parameters, count)
        if all(_error(pose, s, parts) <= _MARGIN * parameters.tolerance for parts in _PARTS for pose in _range(parameters)):
            return _placed(parameters, s)
    raise ValueError(f"tolerance = {parameters.tolerance:g}: must be within reach of {_TRIES[-1]} elements")


def discretize(parameters: PipeParameters) -> tuple[Array, Line]:
    """Arc lengths S (n,) [m] of the nodes, and the line. Raises ValueError as `resolve` does."""
    s = np.array(resolve(parameters).nodes_at)
    return s, _line(parameters, s)


def _mesh(parameters: PipeParameters, count: int) -> Array:
    """Nodes of `count` elements, of the kind the parameters name."""
    if parameters.mesh == "uniform":
        return mesh.even(parameters, count)
    estimate = estimate_tension(parameters)
    for times in _PROBE:
        probe = mesh.graded(parameters, estimate, max(count, min(times * count, _PROBE_LIMIT)))
        found = [_at_rest(pose, probe) for pose in _range(parameters)]
        forces = np.array([one for one in found if one is not None])
        if len(forces):
            break
    else:
        return mesh.graded(parameters, estimate, count)
    largest = forces[:, :, :1].max(axis=1)
    tension = np.maximum(forces[:, :, 0], np.maximum(1e-3 * largest, 1e-9)).max(axis=0)
    return mesh.adapted(parameters, probe, forces[:, :, 4:], np.sqrt(_stiffest(parameters) / tension), count)


def _range(parameters: PipeParameters) -> list[PipeParameters]:
    """The parameters, and those with the top elsewhere in its range, about a bending length sqrt(EI / T) of the foot apart."""
    if not parameters.top_range:
        return [parameters]
    x, y, z = parameters.top_position
    distance, heading = math.hypot(x, y), math.atan2(y, x)
    count = math.ceil(parameters.top_range / math.sqrt(_stiffest(parameters) / max(estimate_tension(parameters)[0], 1e-9)))
    moves = parameters.top_range * np.arange(-count, count + 1) / count
    tops = [((distance + move) * math.cos(heading), (distance + move) * math.sin(heading), z) for move in moves]
    return [replace(parameters, top_position=top, top_range=0.0) for top in tops]


def _stiffest(parameters: PipeParameters) -> float:
    return max(section.stiffness[3] for section in parameters.all_sections)


def _at_rest(parameters: PipeParameters, s: Array) -> Array | None:
    """Nodal section forces (n, 6), material components, of the equilibrium on nodes `s` (n,), if there is one."""
    line, calm = _line(parameters, s), water(parameters, 0.0)
    attitude = np.array(parameters.top_quaternion)
    found = solve(line, s, calm, parameters.top_position, attitude if attitude.any() else None)
    if not found.converged:
        return None
    strain = np.empty((len(s) - 1, ROWS))
    element_strains(line, found.position, found.quaternion, strain)
    zero = np.zeros_like(found.position)
    mass = mass_per_length(parameters, s)
    return section_forces.nodal_wrenches(line, mass, calm, found.position, found.quaternion, zero, zero, strain)


def _error(parameters: PipeParameters, s: Array, parts: int) -> float:
    """Largest relative error on the nodes `s` (n,), inf where there is no equilibrium: of the tension at both ends, of the largest bending
    moment and, over that, of the bending moments at both ends; against elements each divided into so many parts.
    """
    finer = np.append((s[:-1, None] + np.outer(np.diff(s), np.arange(parts) / parts)).ravel(), s[-1])
    coarse, fine = _at_rest(parameters, s), _at_rest(parameters, finer)
    if coarse is None or fine is None:
        return math.inf
    forces, right = section_forces.SectionForces.of(coarse), section_forces.SectionForces.of(fine)
    largest = section_forces.largest_bending_moment(finer, right)
    tension = np.abs(forces.tension[[0, -1]] / right.tension[[0, -1]] - 1.0)
    ends = np.linalg.norm((forces.moment - right.moment[::parts])[[0, -1], 1:], axis=1) / largest
    return float(max(*tension, abs(section_forces.largest_bending_moment(s, forces) / largest - 1.0), *ends))


def _placed(parameters: PipeParameters, s: Array) -> PipeParameters:
    return replace(parameters, nodes=len(s), nodes_at=tuple(float(x) for x in s), tolerance=None)


def _line(parameters: PipeParameters, s: Array) -> Line:
    """Element and node data on the nodes `s` (n,)."""
    h = np.diff(s)
    section = _picker(parameters, s)
    stiffness = section(lambda one: one.stiffness)
    k2, p2 = shear_stiffness(stiffness[:, 1], stiffness[:, 4], h)
    k3, p3 = shear_stiffness(stiffness[:, 1], stiffness[:, 3], h)
    carried = mass_per_length(parameters, s)
    mass = carried.along
    added = np.zeros((0, 3))
    if parameters.added_mass is not None:
        across = carried.across - mass
        added = _lump(np.column_stack([0.0 * across, across, across]), h)
    line = Line(
        length=h,
        stiffness=np.column_stack([stiffness[:, 0], k2, k3, stiffness[:, 2:]]),
        share=np.column_stack([p2, p3]),
        loads=loads_of(parameters, section, _by_section(parameters, s, np.array(parameters.bearing()))),
        mass=_lump(mass[:, None], h)[:, 0],
        offset=_ahead(carried.across, h),
        inertia=_lump(section(lambda one: one.inertia), h),
        spin_damping=_lump(section(lambda one: one.rotational_damping), h),
        added_mass=added,
        damping=np.full(len(h) if parameters.internal_damping > 0.0 else 0, parameters.internal_damping),
        foot_clamped=parameters.foot == "clamped",
        top_clamped=parameters.top == "clamped",
        numerical_damping=float(parameters.numerical_damping),
    )
    return line


def _ahead(mass: Array, h: Array) -> Array:
    """Centres of the lumped masses ahead of their nodes (n,) [m]: the couples m h^2 / 12 of both elements over the mass m h / 2 of both."""
    couple, share = mass * h * h / 12.0, 0.5 * mass * h
    return np.diff(couple, prepend=0.0, append=0.0) / (np.append(share, 0.0) + np.append(0.0, share))


def mass_per_length(parameters: PipeParameters, s: Array) -> section_forces.MassPerLength:
    """Mass per length of the elements between the nodes `s` (n,), along the section and across it."""
    section = _picker(parameters, s)
    along = section(lambda one: one.mass_per_length)
    added = 0.0 if parameters.added_mass is None else parameters.added_mass.coefficient * parameters.environment.water_density
    return section_forces.MassPerLength(along, along + added * section(lambda one: one.outer_area))


def water(parameters: PipeParameters, time: float) -> Water:
    """The water at `time` [s]."""
    return waters(parameters)(time)


def waters(parameters: PipeParameters) -> Callable[[float], Water]:
    """The water as a function of time [s]."""
    environment = parameters.environment
    sticks = any(section.drag_normal > 0.0 or section.drag_tangential > 0.0 for section in parameters.all_sections)
    current, still = environment.current, Water(np.zeros(0), np.zeros((0, 3)), sticks)
    if current is None:
        return lambda time: still
    depths, factors = current.shape(environment.depth)
    levels = np.array(depths) - environment.depth  # from the surface down, so ascending in z
    flow = np.outer(factors, current.velocity)

    def at(time: float) -> Water:
        factor = current.time_factor(time)
        return Water(levels, factor * flow, sticks) if factor != 0.0 else still

    return at


def estimate_tension(parameters: PipeParameters) -> tuple[float, float]:
    """Tension [N] at foot and top of the catenary of the same weight, or of the bar that is stretched, if that gives way first."""
    x, y, z = parameters.top_position
    length, distance, weight = parameters.length, math.hypot(x, y), _mean_weight(parameters)
    height = -z if weight >= 0.0 else z  # a line that floats is the mirror image of one that hangs
    c, _ = catenary.parameter(length, distance, height, parameters.seabed is not None and weight > 0.0)
    least = abs(weight) * c if weight != 0.0 else 0.0
    axial = min(section.stiffness[0] for section in parameters.all_sections)
    stretched = math.dist(parameters.top_position, (0.0, 0.0, 0.0)) / length - 1.0
    if least > -stretched * axial:
        least = catenary.tension(abs(weight) * distance, axial, stretched)
    most = least + abs(weight * z)
    return (least, most) if height >= 0.0 else (most, least)


def _mean_weight(parameters: PipeParameters) -> float:
    sections = parameters.all_sections
    return sum(parameters.weight(section) * (section.length or parameters.length) for section in sections) / parameters.length


def _picker(parameters: PipeParameters, s: Array) -> Callable[[Callable[[Section], object]], Array]:
    """Function that lists a property of the section of every element."""
    def pick(property_of: Callable[[Section], object]) -> Array:
        return _by_section(parameters, s, np.array([property_of(section) for section in parameters.all_sections], dtype=float))

    return pick


def _by_section(parameters: PipeParameters, s: Array, table: Array) -> Array:
    """For every element the row of `table` that belongs to its section."""
    ends = np.cumsum([section.length or parameters.length for section in parameters.all_sections])
    picked: Array = table[np.searchsorted(ends, 0.5 * (s[1:] + s[:-1]))]
    return picked


def _lump(per_length: Array, h: Array) -> Array:
    """Nodal sums (n, k) of a quantity per length (n - 1, k), half of every element to each end."""
    out = np.zeros((len(h) + 1, per_length.shape[1]))
    out[:-1] += 0.5 * h[:, None] * per_length
    out[1:] += 0.5 * h[:, None] * per_length
    return out
