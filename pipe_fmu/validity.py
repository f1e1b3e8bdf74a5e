"""Where a line leaves what its equations, or its steel, bear; measured in every state, and said once each time it is half as bad again.

- Below the sea floor: deeper than its radius under z = 0 where the scene has no bed.
- Above the surface: by more than 1 % of the depth; weight, drag and pressure remain those in water.
- In compression: effective tension of an element below zero by more than 1e-3 of the largest.
- Past yield: von Mises stress over `yield_stress`; where a section has none, a wall of steel strained by more than 0.5 % (line pipe of
  the highest grade, X120, yields at 0.4 %), or any other section by more than the 5 % of the law of small strains.
"""

import math
from typing import NamedTuple

import numpy as np

from .arrays import Array
from .checks import unusual
from .compiled import inner, kernel
from .notes import WARNING, note
from .parameters import PipeParameters
from .rules import MOST_STRETCH

QUIET = np.zeros(5)  # nothing said yet: below, above, compression, strain, yield
STEEL_STRAIN, STEEL_MODULUS = 0.005, 150e9  # strain a steel wall may have without `yield_stress`; Pa, below which a wall is not of steel
SURFACE, SLACK = 0.01, 1e-3  # of the depth, of the largest tension
NO_STRAIN = 1e-7  # of EA: no more tension than this is none
WORSE = 1.5  # times what was said last is said again
WORDS = (
    "the line hangs %.2g m below the sea floor at S = %.4g m, as there is no bed",
    "the line rises %.2g m above the surface at S = %.4g m, where it keeps weight and drag of the water",
    "the line is in compression at S = %.4g m: effective tension %.3g kN",
    "the line is strained by %.2g %% at S = %.4g m, beyond what any pipe steel bears elastically",
    "the line is strained by %.2g %% at S = %.4g m, beyond the law of small strains",
    "past yield: the largest stress is %.3g of the yield stress",
)
HEAVIEST, DENSITIES = 5e4, (50.0, 2e4)  # N/m, kg/m3: submerged weights and mean densities beyond are those of no line


class Limits(NamedTuple):
    """What the measures of a line are held against."""

    deepest: float  # m below z = 0, infinite over a bed
    surface: float  # z of the water's surface, m
    highest: float  # m above the surface
    no_pull: float  # N, a tension that is none
    radius: Array  # (n - 1,) of the wall, m
    bearable: Array  # (n - 1,) strain, infinite where a section has a yield stress


@inner
def bearable(thickness, modulus, yield_stress):
    """Strain that a section bears: infinite where its yield stress says more; numbers that are not given are NaN."""
    if not math.isnan(yield_stress):
        return math.inf
    return STEEL_STRAIN if modulus >= STEEL_MODULUS and not math.isnan(thickness) else MOST_STRETCH


@kernel
def look(s, stiffness, bounds, position, strain, utilisation, told, first, notes):
    """Note each kind that is beyond its limit and half as bad again as `told` (5,), and remember it there.

    s (n,): arc lengths of the nodes; stiffness (n - 1, 6); `utilisation` is that of the yield stress, 0 where there is none; `first`:
    number of the template of the first kind.
    """
    beyond, value, place = np.empty(5), np.empty(5), np.zeros(5)
    beyond[4] = value[4] = utilisation
    if not _measure(position, strain, stiffness, bounds, told, beyond, value, place):
        return
    worst = int(place[3])
    bearable = bounds.bearable[worst]
    for k in range(5):
        if not beyond[k] > max(1.0, WORSE * told[k]):
            continue
        told[k] = beyond[k]
        at = int(place[k])
        where = s[at] if k < 2 else 0.5 * (s[at] + s[min(at + 1, s.shape[0] - 1)])
        if k < 2:
            note(notes, WARNING, first + k, (value[k], where))
        elif k == 2:
            note(notes, WARNING, first + 2, (where, value[2] / 1e3))
        elif k == 3:
            note(notes, WARNING, first + (3 if bearable == STEEL_STRAIN else 4), (100.0 * value[3] * bearable, where))
        else:
            note(notes, WARNING, first + 5, (value[4],))


def of_parameters(parameters: PipeParameters) -> list[str]:
    """One line on each number that is not usual, and on each section whose weight is that of no line: a length may be in mm."""
    found = [text.replace("pipe.environment.", "environment.") for text in unusual(parameters, "pipe")]
    for i, section in enumerate(parameters.all_sections, 1):
        name = f"sections[{i}]" if parameters.sections else "section"
        weight, area = parameters.weight(section), section.outer_area
        if abs(weight) > HEAVIEST:
            found.append(f"pipe.{name}: weighs {weight:.3g} N/m in water, which no line does")
        elif area > 0.0 and not DENSITIES[0] <= (density := section.mass_per_length / area) <= DENSITIES[1]:
            found.append(f"pipe.{name}: has a mean density of {density:.3g} kg/m3, which no line has")
    return found


@kernel
def _measure(position, strain, stiffness, bounds, told, beyond, value, place):
    """Whether anything is beyond its limit and `WORSE` than `told` (5,).

    Fills for each kind but yield how far it is `beyond` (5,), its `value` (5,) [m, m, N, share of the bearable strain] and the node or
    element of its `place` (5,).
    """
    value[0], value[1], value[2], value[3] = -np.inf, -np.inf, np.inf, -np.inf
    place[:] = 0.0
    pull = bounds.no_pull
    for i in range(position.shape[0]):
        z = position[i, 2]
        if z > value[0]:
            value[0], place[0] = z, i
        if bounds.surface - z > value[1]:
            value[1], place[1] = bounds.surface - z, i
    for e in range(strain.shape[0]):
        force = stiffness[e, 0] * strain[e, 0]
        pull = max(pull, abs(force))
        if force < value[2]:
            value[2], place[2] = force, e
        share = (abs(strain[e, 0]) + bounds.radius[e] * np.hypot(strain[e, 4], strain[e, 5])) / bounds.bearable[e]
        if share > value[3]:
            value[3], place[3] = share, e
    beyond[0], beyond[1], beyond[2], beyond[3] = value[0] / bounds.deepest, value[1] / bounds.highest, -value[2] / (SLACK * pull), value[3]
    new = False
    for k in range(5):
        new |= beyond[k] > max(1.0, WORSE * told[k])
    return new
