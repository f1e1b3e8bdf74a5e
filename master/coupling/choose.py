"""The table of the coupling schemes, and the choice by what the ends can do."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from .bond import Bond
from .energy_consistent import EnergyConsistent
from .explicit import Explicit
from .linearly_implicit import LinearlyImplicit
from .one_sided import OneSided
from .scheme import Check, End, Scheme, accept


def _energy_consistent(impedance: End, mobility: End, bond: Bond, macro_step: float, tolerance: float, check: Check) -> Scheme:
    """By iteration, with a single solve of what cannot roll back."""
    if not (impedance.rollback or impedance.yields):
        return LinearlyImplicit(impedance, mobility, bond, macro_step, check)
    one_sided = not (impedance.rollback and mobility.rollback)
    return (OneSided if one_sided else EnergyConsistent)(impedance, mobility, bond, macro_step, tolerance, check)


def _explicit(
    impedance: End, mobility: End, bond: Bond, macro_step: float, tolerance: float, check: Check, *, serial: bool
) -> Scheme:
    return Explicit(impedance, mobility, bond, macro_step, serial, check)


SCHEMES: dict[str, Callable[[End, End, Bond, float, float, Check], Scheme]] = {
    "energy-consistent": _energy_consistent,
    "serial": partial(_explicit, serial=True),
    "parallel": partial(_explicit, serial=False),
}


def coupling(
    scheme: str, impedance: End, mobility: End, bond: Bond, macro_step: float, tolerance: float = 1e-9, check: Check = accept
) -> Scheme:
    """The coupling named `scheme`, of steps of at most `macro_step` [s]; `tolerance`: of the energy exchanged in a step.

    Raises ValueError for a name that is not in SCHEMES.
    """
    if scheme not in SCHEMES:
        raise ValueError(f"scheme = {scheme!r}: must be one of {', '.join(SCHEMES)}")
    return SCHEMES[scheme](impedance, mobility, bond, macro_step, tolerance, check)
