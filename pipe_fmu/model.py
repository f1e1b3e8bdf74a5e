"""Where the nodes of a pipe are placed."""

import math
from dataclasses import replace

import numpy as np

from . import mesh
from .arrays import Array
from .constants import constants_on
from .element.strains import ROWS
from .line import water_at
from .parameters import PipeParameters
from .results import section_forces
from .statics import catenary
from .statics.solve import solve
from .step.system import element_strains
from .vectors import Unit, unpacked

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


def constants(parameters: PipeParameters) -> Array:
    """Constants of a unit, its nodes placed. Raises ValueError as `resolve` does."""
    placed = resolve(parameters)
    return constants_on(placed, np.array(placed.nodes_at))


def unit_on(parameters: PipeParameters, s: Array) -> Unit:
    """The unit with its nodes at `s` (n,) [m]."""
    unit: Unit = unpacked(constants_on(parameters, s))
    return unit


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
    unit = unit_on(parameters, s)
    line, calm = unit.line, water_at(unit.sea, 0.0)
    attitude = np.array(parameters.top_quaternion)
    found = solve(line, s, calm, parameters.top_position, attitude if attitude.any() else None)
    if not found.converged:
        return None
    strain = np.empty((len(s) - 1, ROWS))
    element_strains(line, found.position, found.quaternion, strain)
    zero = np.zeros_like(found.position)
    return section_forces.nodal_wrenches(line, unit.mass, calm, found.position, found.quaternion, zero, zero, strain)


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
