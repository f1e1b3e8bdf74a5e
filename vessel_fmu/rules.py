"""Rules between several parameters: each is a kernel that notes what it refuses and answers whether it does.

NaN, what an absent parameter is, breaks no rule.
"""

from collections.abc import Callable
from typing import Any

from .attitude import Array, along_heading
from .compiled import kernel
from .environment import NEEDS_TABLE
from .notes import ERROR, add_note, blank, texts
from .rigid_body import COUPLINGS, indefinite, largest_coupling, mass_matrix, symmetric_matrix

SEMIDEFINITE = 1e-12  # of the largest damping: a least eigenvalue that much below zero is round-off
TINY = 1e-300
HOLD_PORT = "the output hold_energy; such an FMU must be exported anew"
RULES = (
    *(f"damping.{name} = %g: must leave the damping positive semidefinite, with the other entries" for name in COUPLINGS),
    *(f"added_mass.{name} = %g: must leave the 6 x 6 mass matrix positive definite, with the others" for name in COUPLINGS),
    *(
        f"controller.{mode}_limit = %g: must be >= the hold thrust %.6g {unit}"
        for mode, unit in (("surge", "N"), ("sway", "N"), ("yaw", "N.m"))
    ),
    "controller.integral_ratio = %g: must be < 2 damping_ratio = %g, or the loop is unstable",
    f"environment.current.depths = (): {NEEDS_TABLE}",
    f"hold_force: adds {HOLD_PORT}",
    f"hold_force: changes {HOLD_PORT}",
)  # templates of notes
DAMPING, ADDED_MASS, LIMIT = 0.0, float(len(COUPLINGS)), 2.0 * len(COUPLINGS)  # numbers of the first of a kind
RATIO, TABLE, ADDS_PORT, CHANGES_PORT = (LIMIT + 3.0 + i for i in range(4))


@kernel
def refused_damping(damping: Array, notes: Array) -> bool:
    """Whether damping of these twelve entries would not be positive semidefinite."""
    largest = 0.0
    for k in range(6):
        largest = max(largest, damping[k])
    refused = indefinite(symmetric_matrix(damping), max(SEMIDEFINITE * largest, TINY))
    if refused:
        worst = largest_coupling(damping)
        add_note(notes, ERROR, DAMPING + worst, 1.0, damping[6 + worst], 0.0)
    return refused


@kernel
def refused_added_mass(mass: float, inertia: Array, added_mass: Array, notes: Array) -> bool:
    """Whether the mass matrix would not be positive definite: mass, kg, inertia (3,), kg m^2, twelve entries of the added mass."""
    refused = indefinite(mass_matrix(mass, inertia, added_mass), 0.0)
    if refused:
        worst = largest_coupling(added_mass)
        add_note(notes, ERROR, ADDED_MASS + worst, 1.0, added_mass[6 + worst], 0.0)
    return refused


@kernel
def refused_ratio(damping_ratio: float, integral_ratio: float, notes: Array) -> bool:
    """Whether the control loop would be unstable (Routh)."""
    largest = 2.0 * damping_ratio
    refused = integral_ratio >= largest
    if refused:
        add_note(notes, ERROR, RATIO, 2.0, integral_ratio, largest)
    return refused


@kernel
def refused_limits(hold: Array, yaw: float, limits: Array, notes: Array) -> bool:
    """Whether the hold thrust (3,) in e at the heading `yaw`, rad, is beyond the `limits` (3,) of the controller along the heading."""
    thrust = along_heading(yaw, hold)
    for i in range(3):
        if abs(thrust[i]) > limits[i]:
            add_note(notes, ERROR, LIMIT + i, 2.0, limits[i], abs(thrust[i]))
            return True
    return False


def check(rule: Callable[..., bool], *values: Any, within: str = "") -> None:
    """Raise ValueError (key = value: rule) if `rule` refuses these values; keys are those in the table `within`."""
    notes = blank()
    if rule(*values, notes):
        raise ValueError(texts(notes, RULES)[0].removeprefix(f"{within}."))
