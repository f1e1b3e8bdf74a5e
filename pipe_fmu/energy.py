"""Energies of the pipe, eqs. (71)-(73) with gravity's sign mended."""

from .compiled import inner
from .element import ROWS, STRAINS
from .loads import BED_POINTS, BED_WEIGHTS
from .seabed import contact


@inner
def energies(line, position, quaternion, velocity, rate, flow, strain):
    """(kinetic, elastic, gravity, contact) [J] of a state; arrays as in step_kernel.step_system."""
    kinetic, elastic, gravity, pressed = 0.0, 0.0, 0.0, 0.0
    n = position.shape[0]
    for e in range(n - 1):
        h = line.length[e]
        for k in range(STRAINS):
            elastic += 0.5 * h * line.stiffness[e, k] * strain[e, k] ** 2
        gravity -= h * line.weight[e] * (0.5 * (position[e, 2] + position[e + 1, 2]) + strain[e, ROWS - 1] / 6.0)
        if line.bed.shape[0] > 0:
            pressed += contact_potential(h, line.diameter[e], line.bearing[e], position[e, 2], position[e + 1, 2], strain[e, ROWS - 1])
    for i in range(n):
        for k in range(3):
            kinetic += 0.5 * line.mass[i] * velocity[i, k] ** 2
            kinetic += 0.5 * line.inertia[i, k] * rate[i, k] ** 2
            if flow.shape[0] > 0:
                kinetic += 0.5 * line.added_mass[i, k] * flow[i, k] ** 2
    return kinetic, elastic, gravity, pressed


@inner
def contact_potential(h, diameter, weight, z1, z2, sag):
    """Potential [J] of one element on the bed, at the same points as loads.press."""
    total = 0.0
    for k in range(4):
        x = BED_POINTS[k]
        total += h * BED_WEIGHTS[k] * contact((1.0 - x) * z1 + x * z2 + x * (1.0 - x) * sag, diameter, weight)[0]
    return total
