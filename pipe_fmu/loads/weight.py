"""Submerged weight, eq. (28) with the sign of e3 down: (m_P - rho_w A_e) g e3 per length, even along an element.

Half of an element's weight W acts at either node; that the arc hangs below the chord by the sag c_z adds W / 6 along it, as the integral
of x (1 - x) does.
"""

from ..compiled import inner

LEDGER: dict[str, tuple[str, float | None]] = {"gravity_energy": ("potential energy of the submerged weight, zero at the bed", None)}


@inner
def potential(weight, z1, z2, sag):
    """Potential [J], eq. (73) with gravity's sign mended, of an element of this weight [N]; z_1, z_2 of its nodes and its sag [m]."""
    return -weight * (0.5 * (z1 + z2) + sag / 6.0)  # eq. (73)


@inner
def on_sag(weight):
    """Derivative of the potential with respect to the sag [N]."""
    return -weight / 6.0


@inner
def add_weight(weight, vector):
    """Add the derivative of the potential with respect to the nodes' positions to `vector` (12,)."""
    vector[2] -= 0.5 * weight  # eq. (28)
    vector[8] -= 0.5 * weight
