"""Where a vessel leaves what its equations bear, said once each time it is half as bad again: linear restoring holds to some 20 degrees
of roll and 5 of pitch; and the numbers of its parameters that are not usual.
"""

import math

import numpy as np

from .attitude import Array, angles_from_quaternion
from .checks import usually
from .compiled import inlined, kernel
from .notes import WARNING, add_note
from .parameters import VesselParameters, place
from .rules import RULES
from .vectors import numbers

LIMITS = {"roll": math.radians(20.0), "pitch": math.radians(5.0)}
LARGEST = np.array(list(LIMITS.values()))
WORSE = 1.5  # times what was said last is said again
_BOUNDED = [it for it in numbers(VesselParameters, None) if "usual" in it.metadata]
USUAL = np.array([it.metadata["usual"] for it in _BOUNDED])
PLACES = np.array([place(it.name) for it in _BOUNDED])
ANGLES, NUMBERS = float(len(RULES)), float(len(RULES) + len(LIMITS))  # first message of each kind
MESSAGES = (
    *RULES,
    *(f"the vessel's {name} is %.3g degrees; its restoring holds to some {math.degrees(limit):g}" for name, limit in LIMITS.items()),
    *(f"{'' if it.name.startswith('environment.') else 'vessel.'}{it.name} = %g{usually(it.metadata)}" for it in _BOUNDED),
)


@kernel
def look(quaternion: Array, told: Array, notes: Array) -> None:
    """Note each angle that is beyond its limit and half as large again as `told` (2,), which then holds it, over the limit."""
    angles = angles_from_quaternion(quaternion)
    for i in range(2):
        beyond = abs(angles[i]) / LARGEST[i]
        if beyond > max(1.0, WORSE * told[i]):
            add_note(notes, WARNING, ANGLES + i, 1.0, math.degrees(angles[i]), 0.0)
            told[i] = beyond


@inlined
def look_at_parameters(values: Array, notes: Array) -> None:
    """Note each number that is not usual: its unit may be wrong."""
    for k in range(len(PLACES)):
        value = values[PLACES[k]]
        if value != 0.0 and (value < USUAL[k, 0] or value > USUAL[k, 1]):
            add_note(notes, WARNING, NUMBERS + k, 1.0, value, 0.0)
