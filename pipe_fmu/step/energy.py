"""Energies of the pipe, eqs. (71)-(73) with gravity's sign mended."""

from ..compiled import inner
from ..element.strains import STRAINS
from ..loads import NO_ENERGY, potentials, summed


@inner
def energies(line, position, quaternion, velocity, rate, added_mass_velocity, strain):
    """Energies [J] of a state, eq. (71), in the order of state.ENERGIES; arrays as in step.system.step_system."""
    kinetic, elastic, stored = 0.0, 0.0, NO_ENERGY
    n = position.shape[0]
    for e in range(n - 1):
        h = line.length[e]
        for k in range(STRAINS):
            elastic += 0.5 * h * line.stiffness[e, k] * strain[e, k] ** 2  # eq. (16)
        stored = summed(stored, potentials(line.loads, e, h, position[e, 2], position[e + 1, 2], strain[e, STRAINS]))  # eq. (73)
    for i in range(n):
        for k in range(3):  # eq. (72)
            kinetic += 0.5 * line.mass[i] * velocity[i, k] ** 2
            kinetic += 0.5 * line.inertia[i, k] * rate[i, k] ** 2
            if added_mass_velocity.shape[0] > 0:
                kinetic += 0.5 * line.added_mass[i, k] * added_mass_velocity[i, k] ** 2
    return kinetic, elastic, *stored
