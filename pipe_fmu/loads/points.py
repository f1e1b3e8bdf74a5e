"""Points of an element, at which its distributed loads act.

They move with the linked interpolation of the nodes, phi(x) = (1 - x) phi_1 + x phi_2 + x (1 - x) c, c = d x psi / 2 the sag of the
element's arc, whose rate is taken as c' = (d' x psi + d x (w_2 - w_1 + (w_1 + w_2) x psi / 2)) / 2, exact for a rigid motion (without the
rolling part the drag on the arc would twist the line). Forces reach the nodes by the transpose of the same map, so that the nodal power is
the power at the points, exactly.
"""

from ..compiled import inner
from ..maths.so3 import add, cross, scale


@inner
def depth(x, z1, z2, sag):
    """Depth coordinate z [m] of the point at x, from those of the nodes and the sag of the arc."""
    y = 1.0 - x
    return y * z1 + x * z2 + x * y * sag


@inner
def sag_rate(d, bow, v1, v2, w1, w2):
    """Rate of c = d x psi / 2 [m/s], e; `bow` is psi in e."""
    mean = scale(0.5, add(w1, w2))
    turned = add(add(w2, scale(-1.0, w1)), cross(mean, bow))
    return scale(0.5, add(cross(add(v2, scale(-1.0, v1)), bow), cross(d, turned)))


@inner
def linked_motion(x, d, bow, moves):
    """Matrix (3, 12) from the nodes' (v_1, w_1, v_2, w_2) to the velocity of the point at x."""
    half = 0.5 * x * (1.0 - x)
    for j in range(3):
        unit = (1.0 if j == 0 else 0.0, 1.0 if j == 1 else 0.0, 1.0 if j == 2 else 0.0)
        stretched = cross(unit, bow)
        bent = cross(d, unit)
        rolled = cross(d, stretched)
        for i in range(3):
            moves[i, j] = (1.0 - x) * unit[i] - half * stretched[i]
            moves[i, 6 + j] = x * unit[i] + half * stretched[i]
            moves[i, 3 + j] = half * (0.5 * rolled[i] - bent[i])
            moves[i, 9 + j] = half * (0.5 * rolled[i] + bent[i])


@inner
def linked_forces(x, d, bow, f):
    """F_1, M_1, F_2, M_2 at the nodes [N, N m], e, of a force f at x: the transpose of `linked_motion` times f,

    F_1 = y f - g bow x f,   M_1 = -g f x d + g/2 bow x (f x d),   F_2 = x f + g bow x f,   M_2 = g f x d + g/2 bow x (f x d),

    with y = 1 - x, g = x y / 2.
    """
    half = 0.5 * x * (1.0 - x)
    shifted = scale(half, cross(bow, f))
    lever = cross(f, d)
    rolled, lifted = scale(0.5 * half, cross(bow, lever)), scale(half, lever)
    return add(scale(1.0 - x, f), scale(-1.0, shifted)), add(rolled, scale(-1.0, lifted)), add(scale(x, f), shifted), add(rolled, lifted)


@inner
def add_linked(x, d, bow, f, vector):
    """Add the nodes' share of a force at x to `vector` (12,)."""
    parts = linked_forces(x, d, bow, f)
    for i in range(3):
        for k in range(4):
            vector[3 * k + i] += parts[k][i]
