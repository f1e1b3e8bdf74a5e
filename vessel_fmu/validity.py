"""Where a vessel leaves what its equations bear, said once each time it is half as bad again: linear restoring holds to some 20 degrees
of roll and 5 of pitch."""

import math

import numpy as np

from .attitude import Array, angles_from_quaternion
from .checks import unusual
from .parameters import VesselParameters
from .vessel import State

LIMITS = {"roll": math.radians(20.0), "pitch": math.radians(5.0)}
QUIET = np.zeros(len(LIMITS))  # nothing said yet
WORSE = 1.5  # times what was said last is said again


def look(state: State, told: Array) -> tuple[list[str], Array]:
    """One line on each angle that is beyond its limit and half as large again as `told` (2,), and `told` with them."""
    angles = np.array(angles_from_quaternion(state.quaternion)[: len(LIMITS)])
    beyond = np.abs(angles) / list(LIMITS.values())
    new = beyond > np.maximum(1.0, WORSE * told)
    if not new.any():
        return [], told
    words = [
        f"the vessel's {name} is {math.degrees(angle):.3g} degrees; its restoring holds to some {math.degrees(limit):g}"
        for (name, limit), angle, is_new in zip(LIMITS.items(), angles, new, strict=True)
        if is_new
    ]
    return words, np.where(new, beyond, told)


def of_parameters(parameters: VesselParameters) -> list[str]:
    """One line on each number that is not usual."""
    return [text.replace("vessel.environment.", "environment.") for text in unusual(parameters, "vessel")]
