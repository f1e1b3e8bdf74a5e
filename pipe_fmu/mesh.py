"""Where the nodes stand along the pipe.

The element is fourth-order accurate, so its error is spread evenly where the fourth power of its length follows the second derivative of
the bending moment m(S): the mesh equidistributes |m''|^(1/4), taken from static solutions on a fine mesh (the largest of them all where the
top has a range), spread over the bending length sqrt(EI / T) so that it stays good when the touchdown point or the top moves, and never
falling below a share of its mean. Where the top oscillates, the waves it sends along the line need elements everywhere, and of nearly the
same length from one to the next: most of the density is even, and the monitor is spread farther. Before there is a solution the clamped
ends are refined by their bending length. Sections begin and end at nodes.
"""

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np

from .arrays import Array
from .parameters import PipeParameters

_FINE = 0.6  # element at an end over the bending length
_REACH = 3.0  # its growth distance over the bending length
_FINEST = 0.08  # never shorter than this share of the even element
_ORDER = 4.0
_SPREAD = 1.5  # reach of a maximum of the monitor over the bending length
_SPREAD_FOR_WAVES = 3.0
_FLOOR = 0.2  # of the monitor's mean
_FLOOR_FOR_WAVES = 4.0  # of the spread monitor's mean: no element is longer than 5/4 of the even one

Size = Callable[[Array], Array]


def even(parameters: PipeParameters, count: int) -> Array:
    """Arc lengths S (count + 1,) [m] of a uniform mesh (uniform in every section, of nearly the same length)."""
    return _distribute(parameters, np.ones_like, count)


def graded(parameters: PipeParameters, tension: tuple[float, float], count: int) -> Array:
    """Arc lengths S (count + 1,) [m] of a mesh refined at the ends for the tensions [N] estimated there."""
    ends = []
    sections = parameters.all_sections
    for section, pull, at in ((sections[0], tension[0], 0.0), (sections[-1], tension[1], parameters.length)):
        bending = math.sqrt(section.stiffness[3] / max(pull, 1e-9))
        ends.append((at, min(1.0, max(_FINE * bending * count / parameters.length, _FINEST)), _REACH * bending))

    def size(s: Array) -> Array:
        out = np.ones_like(s)
        for at, smallest, reach in ends:
            out = np.minimum(out, 1.0 - (1.0 - smallest) * np.exp(-np.abs(s - at) / reach))
        return out

    return _distribute(parameters, size, count)


def adapted(parameters: PipeParameters, s: Array, moment: Array, bending_length: Array, count: int) -> Array:
    """Arc lengths S (count + 1,) [m] of a mesh adapted to the bending moments (k, n, 2) [N m] found at `s` (n,) in k poses at rest.

    bending_length (n,): sqrt(EI / T) there [m], the least of all poses.
    """
    slope = np.diff(moment, axis=1) / np.diff(s)[:, None]
    curvature = np.linalg.norm(np.diff(slope, axis=1), axis=2).max(axis=0) / (0.5 * (s[2:] - s[:-2]))
    monitor = np.concatenate([curvature[:1], curvature, curvature[-1:]]) ** (1.0 / _ORDER)
    total = float(np.trapezoid(monitor, s))
    for end, kind in ((0, parameters.foot), (-1, parameters.top)):
        if kind == "clamped":  # whatever it carries at rest, the end of a moving line is bent within its bending length
            monitor[end] = max(monitor[end], total / count / max(_FINE * bending_length[end], _FINEST * s[-1] / count))
    waves = parameters.top_amplitude > 0.0
    decay = np.exp(-np.diff(s) / ((_SPREAD_FOR_WAVES if waves else _SPREAD) * bending_length.max()))
    for i in range(1, len(s)):
        monitor[i] = max(monitor[i], monitor[i - 1] * decay[i - 1])
    for i in range(len(s) - 2, -1, -1):
        monitor[i] = max(monitor[i], monitor[i + 1] * decay[i])
    floor = _FLOOR_FOR_WAVES * float(np.trapezoid(monitor, s)) if waves else _FLOOR * total
    monitor += max(floor / s[-1], 1e-300)
    return _distribute(parameters, lambda at: 1.0 / np.interp(at, s, monitor), count)


def _distribute(parameters: PipeParameters, size: Size, count: int) -> Array:
    """`count` elements whose lengths follow `size`, split among the sections so that every joint is a node.

    Raises ValueError for fewer elements than sections.
    """
    lengths = [section.length or parameters.length for section in parameters.all_sections]
    joints = np.concatenate([[0.0], np.cumsum(lengths)])
    joints *= parameters.length / joints[-1]
    if len(lengths) > count:
        raise ValueError(f"nodes = {count + 1}: must exceed the number of sections, {len(lengths)}")
    grid = np.unique(np.concatenate([np.linspace(a, b, 2000) for a, b in pairwise(joints)]))
    density = 1.0 / size(grid)
    number = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(grid))])
    marks = np.interp(joints, grid, number)
    wanted = np.diff(marks) * count / number[-1]
    parts = np.maximum(1, np.floor(wanted).astype(int))
    while parts.sum() < count:
        parts[np.argmax(wanted / parts)] += 1
    while parts.sum() > count:
        parts[np.argmax(np.where(parts > 1, parts / wanted, 0.0))] -= 1
    pieces = [
        np.concatenate([[start], np.interp(np.linspace(a, b, k + 1)[1:-1], number, grid)])
        for start, (a, b), k in zip(joints[:-1], pairwise(marks), parts, strict=True)
    ]
    return np.concatenate([*pieces, [parameters.length]])
