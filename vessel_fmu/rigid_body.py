"""Inertia of the hull and the water it carries: eq. (48), M nu' + C(nu) nu, in b about the centre of gravity, constant M.

With the momentum P = M nu = (P_1, P_2) the Coriolis and centripetal force is C(nu) nu = (w x P_1, w x P_2 + v x P_1):
eqs. (50)-(52) for the full M, rigid body and added mass alike (Kirchhoff's equations). Its power nu . C(nu) nu vanishes
identically. C acts on the velocity over ground, as printed in (48); the Munk moment of a steady current on the hull is
therefore not in it.
"""

from .attitude import Array, add_cross, apply, dot
from .compiled import kernel


@kernel
def kinetic_energy(mass: Array, nu: Array) -> float:
    """Kinetic energy, J, eq. (75), of the body velocity nu (6,) with the mass matrix (6, 6)."""
    return 0.5 * dot(nu, apply(mass, nu))


@kernel
def add_coriolis(mass: Array, nu: Array, force: Array) -> None:
    """Add C(nu) nu, eqs. (49)-(52), to `force` (6,), N and N m."""
    momentum = apply(mass, nu)
    add_cross(force[:3], 1.0, nu[3:], momentum[:3])
    add_cross(force[3:], 1.0, nu[3:], momentum[3:])
    add_cross(force[3:], 1.0, nu[:3], momentum[:3])
