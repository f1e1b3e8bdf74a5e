"""Cross-section of the pipe, and the stiffnesses and masses that follow from it.

A section is a tube (diameter, wall, material, contents, coating) of which every stiffness follows, or any of its stiffnesses and
masses given directly. Steel area and displaced area are two things: EA needs the one, buoyancy the other. Shear coefficient of the tube:
Cowper (1966). Drag coefficients: normal 1.2, tangential pi times a skin friction of 0.008, both on the outer diameter.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from .checks import check_fields, number
from .tables import numbers

Vector3 = tuple[float, float, float]
THICK = "wall_thickness = %g: must be <= the outer radius %g m"


class Shape(NamedTuple):
    """What follows from the numbers of a section. The wall's area and second moment are 0 for one without a wall."""

    inner: float  # radius of the wall [m]
    outer: float  # m
    steel_area: float  # m2
    second_moment: float  # of area of the wall about a diameter [m4]
    diameter: float  # over the coating, d of eq. (29) [m]
    outer_area: float  # displaced area A_e, from the diameter over the coating [m2]
    mass: float  # m_P per length, with contents and coating [kg/m]
    stiffness: tuple[float, float, float, float, float]  # EA, GA [N], GJ, EI_2, EI_3 [N m2], eqs. (18), (19)
    inertia: Vector3  # J_1, J_2, J_3 of eq. (27) [kg m], of the wall; without a wall, of a disc of the section's mass


@dataclass(frozen=True)
class Section:
    """Cross-section: a tube, or the stiffnesses and masses that are given directly."""

    length: float | None = number(None, "m", "length of this section, foot to top (only in a list of sections)", above=0.0)
    outer_diameter: float = number(0.4064, "m", "outer diameter of the steel", above=0.0, usual=(0.01, 3.0))
    wall_thickness: float | None = number(0.0222, "m", "wall thickness", above=0.0)
    youngs_modulus: float = number(207e9, "Pa", "Young's modulus E", above=0.0, usual=(5e8, 1e12))
    poisson_ratio: float = number(0.3, "1", "Poisson's ratio", min=0.0, max=0.5)
    density: float = number(7850.0, "kg/m3", "density of the wall", min=0.0, usual=(500.0, 2e4))
    contents_density: float = number(0.0, "kg/m3", "density of what fills the pipe", min=0.0, usual=(0.1, 5e3))
    coating_thickness: float = number(0.0, "m", "thickness of the coating (weight and buoyancy, no stiffness)", min=0.0, usual=(1e-5, 1.0))
    coating_density: float = number(0.0, "kg/m3", "density of the coating", min=0.0, usual=(50.0, 5e3))
    yield_stress: float | None = number(None, "Pa", "yield stress of the wall; absent: no utilisation", above=0.0, usual=(1e6, 3e9))
    drag_normal: float = number(1.2, "1", "D_2 = D_3 of eq. (30)", min=0.0, usual=(0.0, 5.0))
    drag_tangential: float = number(0.025, "1", "D_1 of eq. (30)", min=0.0, usual=(0.0, 2.0))
    rotational_damping: Vector3 = number((1.5, 1.5, 1.5), "N.s", "D_4, D_5, D_6 of eq. (32) per length, in the section's frame t", min=0.0)
    axial_stiffness: float | None = number(None, "N", "EA, instead of the tube's", above=0.0, usual=(1e5, 1e12))
    shear_stiffness: float | None = number(None, "N", "GA_2 = GA_3, instead of the tube's", above=0.0, usual=(1e4, 1e12))
    torsional_stiffness: float | None = number(None, "N.m2", "GJ, instead of the tube's", above=0.0, usual=(1e-2, 1e12))
    bending_stiffness: float | None = number(
        None, "N.m2", "EI_2 (and EI_3 unless given), instead of the tube's", above=0.0, usual=(1e-2, 1e12)
    )
    bending_stiffness_3: float | None = number(None, "N.m2", "EI_3, where it differs from EI_2", above=0.0)
    mass: float | None = number(None, "kg/m", "m_P with contents and coating, instead of the tube's", above=0.0, usual=(0.1, 2e4))
    displaced_area: float | None = number(None, "m2", "area that displaces water, instead of the tube's", min=0.0, usual=(1e-5, 10.0))
    rotational_inertia: Vector3 | None = number(None, "kg.m", "J_1, J_2, J_3 of eq. (27), in frame t, instead of the tube's", above=0.0)

    def __post_init__(self) -> None:
        check_fields(self)
        if self.wall_thickness is None:
            for key in ("axial_stiffness", "shear_stiffness", "torsional_stiffness", "bending_stiffness", "mass"):
                if getattr(self, key) is None:
                    raise ValueError(f"{key}: must be given where there is no wall_thickness")
        elif (radius := 0.5 * self.outer_diameter) < self.wall_thickness:
            raise ValueError(THICK % (self.wall_thickness, radius))

    @cached_property
    def shape(self) -> Shape:
        """What follows from the numbers."""
        return shape_of(tuple(value for _, value in numbers(Section, self)))

    @property
    def radii(self) -> tuple[float, float]:
        """Inner and outer radius of the wall [m]."""
        return self.shape.inner, self.shape.outer

    @property
    def steel_area(self) -> float:
        """Area of the wall [m2]."""
        return self.shape.steel_area

    @property
    def second_moment(self) -> float:
        """Second moment of area of the wall about a diameter [m4]."""
        return self.shape.second_moment

    @property
    def hydrodynamic_diameter(self) -> float:
        """Diameter over the coating, d of eq. (29) [m]."""
        return self.shape.diameter

    @property
    def outer_area(self) -> float:
        """Displaced area A_e, from the diameter over the coating [m2]."""
        return self.shape.outer_area

    @property
    def mass_per_length(self) -> float:
        """m_P with contents and coating [kg/m]."""
        return self.shape.mass

    @property
    def stiffness(self) -> tuple[float, float, float, float, float]:
        """EA, GA [N], GJ, EI_2, EI_3 [N m2], eqs. (18), (19)."""
        return self.shape.stiffness

    @property
    def inertia(self) -> Vector3:
        """J_1, J_2, J_3 of eq. (27) [kg m], of the wall; without a wall, of a disc of the section's mass."""
        return self.shape.inertia


NAMES = tuple(name for name, _ in numbers(Section, None))
(
    _, DIAMETER, WALL, MODULUS, POISSON, DENSITY, CONTENTS, COATING, COATING_DENSITY, YIELD, DRAG_NORMAL, DRAG_TANGENTIAL,
    ROTATIONAL_DAMPING, _, _, _AXIAL, _SHEAR, _TORSION, _BENDING, _BENDING_3, _MASS, _AREA, _INERTIA,
) = range(len(NAMES) - 2)  # fmt: skip


def shape_of(row):
    """What follows from the numbers `row` of a section, in the order of NAMES, NaN where one is absent; compiled by constants.py."""
    outer, modulus, poisson = 0.5 * row[DIAMETER], row[MODULUS], row[POISSON]
    walled = not math.isnan(row[WALL])
    inner = outer - row[WALL] if walled else outer
    area = math.pi * (outer * outer - inner * inner)
    second_moment = 0.25 * math.pi * (outer * outer * outer * outer - inner * inner * inner * inner)
    over = outer + row[COATING]
    displaced = math.pi * (over * over) if math.isnan(row[_AREA]) else row[_AREA]
    coating = math.pi * (over * over - outer * outer)
    mass = row[_MASS]
    across = mass
    if math.isnan(mass):
        mass = row[DENSITY] * area + row[CONTENTS] * math.pi * (inner * inner) + row[COATING_DENSITY] * coating
        across = row[DENSITY] * second_moment
    elif walled:
        across = mass / area * second_moment
    else:  # a disc
        across = mass * displaced / (4.0 * math.pi)
    shear_modulus = 0.5 * modulus / (1.0 + poisson)
    m = inner / outer
    thick = (1.0 + m * m) * (1.0 + m * m)
    factor = 6.0 * (1.0 + poisson) * thick / ((7.0 + 6.0 * poisson) * thick + (20.0 + 12.0 * poisson) * m * m)
    axial = modulus * area if math.isnan(row[_AXIAL]) else row[_AXIAL]
    shear = factor * shear_modulus * area if math.isnan(row[_SHEAR]) else row[_SHEAR]
    torsion = 2.0 * shear_modulus * second_moment if math.isnan(row[_TORSION]) else row[_TORSION]
    bending = modulus * second_moment if math.isnan(row[_BENDING]) else row[_BENDING]
    bending_3 = bending if math.isnan(row[_BENDING_3]) else row[_BENDING_3]
    inertia = (2.0 * across, across, across)  # eq. (27)
    if not math.isnan(row[_INERTIA]):
        inertia = (row[_INERTIA], row[_INERTIA + 1], row[_INERTIA + 2])
    stiffness = (axial, shear, torsion, bending, bending_3)  # eqs. (18), (19)
    return Shape(inner, outer, area, second_moment, 2.0 * over, displaced, mass, stiffness, inertia)


def weight_in_water(mass, area, water_density, gravity):
    """Submerged weight per length [N/m] of a section of mass per length [kg/m] and displaced area [m2]."""
    return (mass - water_density * area) * gravity


def bearing(weight, heaviest, lightest, reference):
    """Weight per length [N/m] of a section from which the bed's stiffness under it follows.

    It is the `reference` (unless NaN), or the section's own; for a section that floats, that of the heaviest (of the lightest, if all
    float).
    """
    if not math.isnan(reference):
        return reference
    if weight > 0.0:
        return weight
    return heaviest if heaviest > 0.0 else -lightest
