"""The distributed loads on an element, one module each: its law beside its potential or its power, its part of a step, of statics and of
what is recovered.

A load that is added gets a module, a field of `Loads` and a line in each function here; works, energies and ports follow from
the modules' `LEDGER`. Every function takes what all loads may need, and calls them in one order.
"""

from typing import Any, NamedTuple

from ..arrays import Array, distinct
from ..compiled import inner, kernel
from ..element.assembly import expand
from ..element.strains import STRAINS
from ..simd.columns import column, columns
from ..simd.lane_arrays import group, lane
from . import bed, drag, weight
from .bed import Bed, Seabed

__all__ = ["Bed", "Loads", "Seabed"]

LEDGER = weight.LEDGER | drag.LEDGER | bed.LEDGER  # ports of energies and works: what they are, and the least they can be
_WORKS = [port for port in LEDGER if not port.endswith("_energy")]
CURRENT, DRAG, CONTACT = (_WORKS.index(port) for port in ("current_work", "drag_dissipation", "contact_dissipation"))
NO_ENERGY = (0.0, 0.0)  # potentials, in the order of the ledger


@distinct
class Loads(NamedTuple):
    """What the loads need to know of every element."""

    weight: Array  # (n-1,) submerged weight per length [N/m], eq. (28)
    drag: Array  # (n-1, 2) rho d D_1 / 2, rho d D_2 / 2 [N s^2/m^3], eq. (29)
    bed: Bed


def present(parameters: Any) -> dict[str, bool]:
    """Whether the parameters name the physics behind a port of the ledger, of those that may be absent."""
    return dict.fromkeys(bed.LEDGER, parameters.seabed is not None)


@inner
def fill_loads(loads, e, weight, bearing, diameter, water_density, tangential, normal):
    """Fill in the loads on element e: its submerged weight per length [N/m] and that which lies at z = 0, the diameter over its coating
    [m], and its coefficients of drag.
    """
    loads.weight[e] = weight
    loads.drag[e, 0], loads.drag[e, 1] = 0.5 * water_density * diameter * tangential, 0.5 * water_density * diameter * normal
    if bed.present(loads.bed):
        loads.bed.bearing[e], loads.bed.diameter[e] = bearing, diameter


@kernel
def loads_columns(loads, n):
    """The loads with their arrays as columns (simd/columns.py), of no effect behind the last element."""
    return Loads(column(loads.weight, n, 0.0), columns(loads.drag, n, 0.0), bed.bed_columns(loads.bed, n))


@inner
def potentials(loads, e, h, z1, z2, sag):
    """Potentials [J] of element e of length h [m], in the order of the ledger; z_1, z_2 of its nodes and its sag [m]."""
    pressed = bed.potential(loads.bed, e, h, z1, z2, sag) if bed.present(loads.bed) else 0.0
    return weight.potential(h * loads.weight[e], z1, z2, sag), pressed


@inner
def summed(totals, more):
    """Sum of two tuples of potentials."""
    return totals[0] + more[0], totals[1] + more[1]


@inner
def lies(loads):
    """Whether a load changes with the sag, so that its gradients are needed."""
    return bed.present(loads.bed)


@inner
def even_on_sag(loads, a, h):
    """Derivative with respect to the sag [N] of the loads that are even along an element, or those of a group."""
    return weight.on_sag(h * loads.weight[a])


@inner
def _heights(e, old, new):
    """(z of the two nodes and sag) of element e before and after a step."""
    moves, _, new_strain = new
    before = old[0][e], old[0][e + 1], old[5][STRAINS, e]
    return before, (before[0] + moves[2, e], before[1] + moves[2, e + 1], new_strain[STRAINS, e])


@inner
def press_mean_sag(loads, first, count, length, h, old, new, stress):
    """Add what bears on the sags of `count` elements from `first` on over a step of h [s] to `stress` (7,), for the geometric stiffness."""
    for m in range(count):
        e = first + m
        lane(stress, m)[STRAINS] += bed.mean_on_sag(loads.bed, e, length[e], h, *_heights(e, old, new))


@inner
def add_mean_loads(line, water, first, count, step, middle, ends, gradients, want, into):
    """Add minus the mean loads over a step on `count` elements from `first` on, their tangent and their works.

    step: its length h [s], and old and new columns as in step.system.assemble; middle: frame, chord and relative rotation half way; ends
    (2, 6): mean velocities of the nodes; gradients: of strains and sag, averaged over the step and at its end, two (7, 9); want: whether
    the tangent, and whether Newton's of friction (`bed.add_mean_contact`); into: forces (12,), tangent (12, 12), scratch of two (3, 12),
    works.
    """
    (h, old, new), (mean, final), (vector, matrix, scratch, sums) = step, gradients, into
    a, b = group(first), group(first + 1)
    loads, moves, z = line.loads, new[0], old[0]
    weight.add_weight(line.length[a] * loads.weight[a], vector)
    if water.drag:
        depths = z[a] + 0.5 * moves[2, a], z[b] + 0.5 * moves[2, b]
        how = (loads.drag[0, a], loads.drag[1, a]), ends, depths, water.levels, water.velocities, 1.0 / h, want[0]
        dissipated, supplied = drag.add_mean_drag(*middle, line.length[a], *how, vector, matrix, scratch)
        sums[DRAG] += h * dissipated
        sums[CURRENT] += h * supplied
    if bed.present(loads.bed):
        for m in range(count):
            e = first + m
            rows = lane(ends, m), lane(mean, m)[STRAINS], lane(final, m)[STRAINS]
            ours = lane(vector, m), lane(matrix, m), (lane(scratch[0], m),)
            on_bed = loads.bed, e, line.length[e], h, *_heights(e, old, new)
            lane(sums, m)[CONTACT] += bed.add_mean_contact(*on_bed, *rows, *want, *ours)


@inner
def press_sag(loads, e, h, z1, z2, sag, points):
    """Potentials [J] of the loads at rest, as `potentials`, and their sum's derivative with respect to the sag [N]; the bed's reaction goes
    into `points` (4, 2), for `add_static_loads`.
    """
    pressed, on_sag = bed.press(loads.bed, e, h, z1, z2, sag, points) if bed.present(loads.bed) else (0.0, 0.0)
    return (weight.potential(h * loads.weight[e], z1, z2, sag), pressed), even_on_sag(loads, e, h) + on_sag


@inner
def add_static_loads(line, water, e, arc, z1, z2, sag_row, points, row, vector, matrix, pull):
    """Add minus the loads on element e at rest to `vector` (12,), those without a potential to `pull` (12,) too, and their tangent to
    `matrix` (12, 12).

    arc: its frame, chord and relative rotation; sag_row (9,): gradient of its sag; points: of `press_sag`; scratch `row` (12,).
    """
    h, loads = line.length[e], line.loads
    weight.add_weight(h * loads.weight[e], vector)
    if bed.present(loads.bed):
        bed.add_press(points, vector)
        bed.add_press_stiffness(points, sag_row, matrix, row)
    if water.drag and water.levels.shape[0] > 0:
        drag.add_static_drag(*arc, h, loads.drag[e], z1, z2, water.levels, water.velocities, pull, matrix)
        for i in range(12):
            vector[i] += pull[i]


@inner
def add_instant_loads(line, water, first, count, arc, position, sags, ends, sag_row, vector, scratch):
    """Add minus the loads at an instant on `count` elements from `first` on, but for what bears on the sag evenly, to `vector` (12,).

    arc: frames, chords and relative rotations; position (3, p), sags (p,): columns; ends (2, 6): velocities of the nodes; sag_row (9,):
    gradient of the sag; scratch: (12, 12), two (3, 12), (4, 2), (12,). Damping and friction of the bed are left out.
    """
    unused, drags, points, by_sag = scratch
    a, b = group(first), group(first + 1)
    loads, z = line.loads, position[2]
    weight.add_weight(line.length[a] * loads.weight[a], vector)
    if water.drag:
        how = (loads.drag[0, a], loads.drag[1, a]), ends, (z[a], z[b]), water.levels, water.velocities, 0.0, False
        drag.add_mean_drag(*arc, line.length[a], *how, vector, unused, drags)
    if bed.present(loads.bed):
        for m in range(count):
            e, ours = first + m, lane(vector, m)
            _, on_sag = bed.press(loads.bed, e, line.length[e], z[e], z[e + 1], sags[e], lane(points, m))
            bed.add_press(lane(points, m), ours)
            expand(lane(sag_row, m), lane(by_sag, m))
            for i in range(12):
                ours[i] += on_sag * lane(by_sag, m)[i]
