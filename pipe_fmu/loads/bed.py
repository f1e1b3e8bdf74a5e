"""Elastic seabed: reaction of the plane z = 0 (e3 down) on a pipe, with damping and Coulomb friction.

The law is linear with a quadratic foot, continuous with its slope. With the penetration p = z + d/8, d the outer diameter and w the
submerged weight per length (for a section that floats, that of the heaviest, or one that is given),

    force = 0 (p < 0),   10 w p^2 / ((d/8 - d/40) d) (0 <= p <= d/20),   w (p - d/40) / (d/8 - d/40) above,

so that a pipe lying at z = 0 is carried by exactly its weight (published pipelay law, shifted by d/8 because the foot lies at z = 0).
Over a step the elastic reaction is the potential's discrete gradient, z and sag by sag of the element's arc at four Gauss points.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from ..arrays import Array, distinct
from ..checks import check_fields, number
from ..compiled import inner, kernel
from ..element.assembly import add_outer, expand
from ..simd.columns import column
from .points import depth

LEDGER: dict[str, tuple[str, float | None]] = {
    "contact_energy": ("potential energy of the bed", 0.0),
    "contact_dissipation": ("energy dissipated by damping and friction of the bed since the start", 0.0),
}
POINTS = (0.06943184420297371, 0.33000947820757187, 0.6699905217924281, 0.9305681557970262)
_WEIGHTS = (0.17392742256872692, 0.32607257743127307, 0.32607257743127307, 0.17392742256872692)


@dataclass(frozen=True)
class Seabed:
    """Elastic bed in the plane z = 0, with damping and Coulomb friction."""

    damping: float = number(1.0, "s/m", "dashpot: share of the elastic reaction per speed of penetration", min=0.0)
    friction: float = number(0.0, "1", "Coulomb coefficient", min=0.0)
    friction_speed: float = number(1e-3, "m/s", "speed below which friction is viscous", above=0.0)
    reference_weight: float | None = number(
        None, "N/m", "weight per length that lies at z = 0, from which the stiffness follows, instead of the section's", above=0.0
    )

    def __post_init__(self) -> None:
        check_fields(self)


@distinct
class Bed(NamedTuple):
    """The bed under every element; without entries where there is none."""

    bearing: Array  # (n-1,) weight per length w from which the stiffness follows [N/m]
    diameter: Array  # (n-1,) outer diameter d [m]
    damping: float  # [s/m]
    friction: float  # [-]
    friction_speed: float  # [m/s]


@kernel
def bed_columns(bed, n):
    """The bed with its arrays as columns (simd/columns.py)."""
    return Bed(column(bed.bearing, n, 0.0), column(bed.diameter, n, 1.0), bed.damping, bed.friction, bed.friction_speed)


@inner
def present(bed):
    """Whether there is a bed."""
    return bed.bearing.shape[0] > 0


@inner
def contact(z, diameter, weight):
    """Potential [J/m], force [N/m, upward positive] and stiffness [N/m^2] of the bed on a pipe at depth coordinate z."""
    p = z + 0.125 * diameter
    if p <= 0.0:
        return 0.0, 0.0, 0.0
    stiffness = weight / (0.1 * diameter)
    knee = 0.05 * diameter
    if p <= knee:
        a = 10.0 * weight / (0.1 * diameter * diameter)
        return a * p**3 / 3.0, a * p * p, 2.0 * a * p
    q = p - 0.025 * diameter
    at_knee = 0.025 * diameter
    foot = 10.0 * weight / (0.1 * diameter * diameter) * knee**3 / 3.0
    return foot + 0.5 * stiffness * (q * q - at_knee * at_knee), stiffness * q, stiffness


@inner
def mean_contact(z_old, z_new, diameter, weight):
    """Mean of the force over the way from one position to another, a discrete gradient, and its derivative with respect to z_new.

    force * (z_new - z_old) is the potential's increase exactly: on each of its three pieces the law is a parabola, of which Simpson's
    rule takes the mean without the cancellation of a difference of potentials.
    """
    step = z_new - z_old
    if step == 0.0:
        _, force, k = contact(z_old, diameter, weight)
        return force, 0.5 * k
    low, high = min(z_old, z_new), max(z_old, z_new)
    mean, start = 0.0, -0.125 * diameter
    for end in (-0.075 * diameter, math.inf):
        a, b = max(low, start), min(high, end)
        if b > a:
            ends = contact(a, diameter, weight)[1] + contact(b, diameter, weight)[1]
            mean += (b - a) / (high - low) * (ends + 4.0 * contact(0.5 * (a + b), diameter, weight)[1]) / 6.0
        start = end
    _, force, k = contact(z_new, diameter, weight)
    if math.fabs(step) < 1e-6 * diameter:
        return mean, 0.5 * k
    return mean, (force - mean) / step


@inner
def mean_on_sag(bed, e, h, dt, old, new):
    """Part of the bed's reaction over a step that bears on the sag [N]: for the tangent, as it goes with the sag's second derivative.

    Arguments as in `add_mean_contact`; with `old` = `new` the static reaction.
    """
    diameter, weight, damping = bed.diameter[e], bed.bearing[e], bed.damping
    total = 0.0
    for k in range(4):
        x = POINTS[k]
        y = 1.0 - x
        z_old, z_new = depth(x, old[0], old[1], old[2]), depth(x, new[0], new[1], new[2])
        force, _ = mean_contact(z_old, z_new, diameter, weight)
        total += h * _WEIGHTS[k] * x * y * force * max(0.0, 1.0 + damping * (z_new - z_old) / dt)
    return total


@inner
def press(bed, e, h, z1, z2, sag, points):
    """Static reaction of the bed on element e: upward force [N] and stiffness [N/m] of its points into `points` (4, 2).

    Returns (potential [J], its derivative with respect to the sag [N]).
    """
    diameter, weight = bed.diameter[e], bed.bearing[e]
    potential, on_sag = 0.0, 0.0
    for k in range(4):
        x = POINTS[k]
        u, force, stiffness = contact(depth(x, z1, z2, sag), diameter, weight)
        share = h * _WEIGHTS[k]
        points[k, 0], points[k, 1] = share * force, share * stiffness
        potential += share * u
        on_sag += x * (1.0 - x) * share * force
    return potential, on_sag


@inner
def add_press(points, vector):
    """Add the nodes' share of the reaction to `vector` (12,), without what goes by way of the sag."""
    for k in range(4):
        x = POINTS[k]
        vector[2] += (1.0 - x) * points[k, 0]
        vector[8] += x * points[k, 0]


@inner
def add_press_stiffness(points, sag_row, matrix, row):
    """Add the tangent of the reaction to `matrix` (12, 12), but for the turning of `sag_row` (9,), the gradient of the sag; `row` (12,)."""
    for k in range(4):
        if points[k, 1] == 0.0:
            continue
        _depth_row(sag_row, POINTS[k], row)
        add_outer(matrix, points[k, 1], row, row)


@inner
def _depth_row(sag_row, x, row):
    """Fill `row` (12,) with the gradient of the depth at x, from that of the sag (9,)."""
    expand(sag_row, row)
    for i in range(12):
        row[i] *= x * (1.0 - x)
    row[2] += 1.0 - x
    row[8] += x


@inner
def add_mean_contact(bed, e, h, dt, old, new, ends, mean_row, new_row, with_tangent, newton_friction, vector, matrix, scratch):
    """Reaction of the bed on element e over a step: discrete gradient of the potential, damping and friction.

    `old`, `new` (3,): z of the two nodes and sag before and after; `ends` (2, 6) mean velocities; `mean_row`, `new_row` (9,) gradients
    of the sag, averaged over the step and at its end; h: length of the element, dt: of the step. The dashpot's force is damping * z'
    times the elastic force: it acts in contact only, and at most takes that force away. Friction is Coulomb's, regularised.
    Tangent if `with_tangent`; that of friction is Newton's if `newton_friction`, else one that never underrates it, with which no
    correction overshoots. `scratch`: one of (3, 12). Returns the work dissipated [J].
    """
    diameter, weight, dissipated = bed.diameter[e], bed.bearing[e], 0.0
    row, row_new = scratch[0][0], scratch[0][1]
    for k in range(4):
        x = POINTS[k]
        z_old, z_new = depth(x, old[0], old[1], old[2]), depth(x, new[0], new[1], new[2])
        force, slope = mean_contact(z_old, z_new, diameter, weight)
        if force == 0.0 and slope == 0.0:
            continue
        share = h * _WEIGHTS[k]
        _depth_row(mean_row, x, row)
        if with_tangent:
            _depth_row(new_row, x, row_new)
        rate = 0.0  # of the points' depth; from the velocities, as a difference of depths over a very short step is round-off
        for i in range(6):
            rate += row[i] * ends[0, i] + row[6 + i] * ends[1, i]
        hardening = max(0.0, 1.0 + bed.damping * rate)  # the bed pushes, it never holds a pipe that leaves it
        total = force * hardening
        dissipated += share * (total - force) * rate * dt
        for i in range(12):
            vector[i] += share * total * row[i]
        if with_tangent:
            add_outer(matrix, share * (slope * hardening + (force * bed.damping / dt if hardening > 0.0 else 0.0)), row, row_new)
        if bed.friction > 0.0:
            dissipated += _add_friction(bed, x, share, dt, force, slope, ends, row_new, with_tangent, newton_friction, vector, matrix)
    return dissipated


@inner
def _add_friction(bed, x, share, dt, force, slope, ends, row_new, with_tangent, newton_friction, vector, matrix):
    """Add Coulomb friction at x, regularised, under the elastic reaction `force` per length, whose derivative is `slope`, over `share` [m].

    Arguments else as in `add_mean_contact`; row_new (12,): gradient of the point's depth. Returns the work dissipated [J].
    """
    y = 1.0 - x
    vx = y * ends[0, 0] + x * ends[1, 0]
    vy = y * ends[0, 1] + x * ends[1, 1]
    speed = math.sqrt(vx * vx + vy * vy + bed.friction_speed * bed.friction_speed)
    grip = share * bed.friction / speed
    f = grip * force
    bent = 1.0 / (speed * speed) if newton_friction else 0.0
    for i in range(2):
        v_i = vx if i == 0 else vy
        vector[i] += y * f * v_i
        vector[6 + i] += x * f * v_i
        for j in range(2 if with_tangent else 0):
            v_j = vx if j == 0 else vy
            k_ij = f / dt * ((1.0 if i == j else 0.0) - v_i * v_j * bent)
            matrix[i, j] += y * y * k_ij
            matrix[i, 6 + j] += x * y * k_ij
            matrix[6 + i, j] += x * y * k_ij
            matrix[6 + i, 6 + j] += x * x * k_ij
        if with_tangent and newton_friction:
            for j in range(12):
                pressed = grip * v_i * slope * row_new[j]
                matrix[i, j] += y * pressed
                matrix[6 + i, j] += x * pressed
    return f * (vx * vx + vy * vy) * dt


@inner
def potential(bed, e, h, z1, z2, sag):
    """Potential [J] of element e on the bed."""
    total = 0.0
    for k in range(4):
        total += h * _WEIGHTS[k] * contact(depth(POINTS[k], z1, z2, sag), bed.diameter[e], bed.bearing[e])[0]
    return total
