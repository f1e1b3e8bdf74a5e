"""Parameters of the pipe; the defaults are a 16 in x 22.2 mm steel pipe of 1200 m, laid empty in 800 m of water.

A section is a tube (diameter, wall, material, contents, coating) of which every stiffness follows, or any of its stiffnesses and
masses given directly. Steel area and displaced area are two things: EA needs the one, buoyancy the other. Shear coefficient of the tube:
Cowper (1966). Drag coefficients: normal 1.2, tangential pi times a skin friction of 0.008, both on the outer diameter.
"""

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal

from .checks import check_fields, number
from .environment import Environment
from .loads import Seabed

Vector3 = tuple[float, float, float]
End = Literal["clamped", "pinned"]
MOST_STRETCH = 0.05  # mean strain up to which a line may be stretched: the law (20) is that of small strains
_SUBSTEPS = (1, 3, 9, 27, 81, 243, 729)


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
        elif self.wall_thickness > 0.5 * self.outer_diameter:
            raise ValueError(f"wall_thickness = {self.wall_thickness:g}: must be <= the outer radius {0.5 * self.outer_diameter:g} m")

    @property
    def radii(self) -> tuple[float, float]:
        """Inner and outer radius of the wall [m]."""
        return 0.5 * self.outer_diameter - (self.wall_thickness or 0.0), 0.5 * self.outer_diameter

    @property
    def steel_area(self) -> float:
        """Area of the wall [m2]."""
        inner, outer = self.radii
        return math.pi * (outer**2 - inner**2)

    @property
    def second_moment(self) -> float:
        """Second moment of area of the wall about a diameter [m4]."""
        inner, outer = self.radii
        return 0.25 * math.pi * (outer**4 - inner**4)

    @property
    def hydrodynamic_diameter(self) -> float:
        """Diameter over the coating, d of eq. (29) [m]."""
        return self.outer_diameter + 2.0 * self.coating_thickness

    @property
    def outer_area(self) -> float:
        """Displaced area A_e, from the diameter over the coating [m2]."""
        return 0.25 * math.pi * self.hydrodynamic_diameter**2 if self.displaced_area is None else self.displaced_area

    @property
    def mass_per_length(self) -> float:
        """m_P with contents and coating [kg/m]."""
        if self.mass is not None:
            return self.mass
        inner, outer = self.radii
        coating = math.pi * ((outer + self.coating_thickness) ** 2 - outer**2)
        return self.density * self.steel_area + self.contents_density * math.pi * inner**2 + self.coating_density * coating

    @property
    def stiffness(self) -> tuple[float, float, float, float, float]:
        """EA, GA [N], GJ, EI_2, EI_3 [N m2], eqs. (18), (19)."""
        modulus, poisson = self.youngs_modulus, self.poisson_ratio
        shear_modulus = 0.5 * modulus / (1.0 + poisson)
        inner, outer = self.radii
        m = inner / outer
        thick = (1.0 + m * m) ** 2
        shear_factor = 6.0 * (1.0 + poisson) * thick / ((7.0 + 6.0 * poisson) * thick + (20.0 + 12.0 * poisson) * m * m)
        bending = _given(self.bending_stiffness, modulus * self.second_moment)
        return (
            _given(self.axial_stiffness, modulus * self.steel_area),
            _given(self.shear_stiffness, shear_factor * shear_modulus * self.steel_area),
            _given(self.torsional_stiffness, 2.0 * shear_modulus * self.second_moment),
            bending,
            _given(self.bending_stiffness_3, bending),
        )

    @property
    def inertia(self) -> Vector3:
        """J_1, J_2, J_3 of eq. (27) [kg m], of the wall; without a wall, of a disc of the section's mass."""
        if self.rotational_inertia is not None:
            return self.rotational_inertia
        area = self.steel_area if self.wall_thickness is not None else self.outer_area
        second = self.second_moment if self.wall_thickness is not None else self.outer_area**2 / (4.0 * math.pi)
        across = (self.density if self.mass is None else self.mass / area) * second
        return 2.0 * across, across, across


@dataclass(frozen=True)
class AddedMass:
    """Added mass across the section, C_A rho A_e, in the material frame."""

    coefficient: float = number(1.0, "1", "C_A", min=0.0)

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class PipeParameters:
    """A pipe from its foot on the bed, at the origin, to the hang-off point."""

    length: float = number(1200.0, "m", "unstretched length L", above=0.0, usual=(1.0, 3e4))
    nodes: int = number(48, "1", "number of nodes", min=3, max=100000)
    tolerance: float | None = number(
        None, "1", "relative error allowed in tension and bending moments at rest; overrides `nodes`", min=1e-6, max=0.1
    )
    mesh: Literal["adapted", "uniform"] = field(default="adapted", metadata={"doc": "elements adapted to the equilibrium, or equal"})
    nodes_at: tuple[float, ...] = number((), "m", "arc lengths of the nodes; empty: placed as `mesh` says", min=0.0)
    foot: End = field(default="clamped", metadata={"doc": "foot: clamped along x, or pinned"})
    top: End = field(default="clamped", metadata={"doc": "top: clamped to the vessel, or pinned"})
    top_position: Vector3 = number((804.7189562, 0.0, -800.0), "m", "start position of the top, in e")
    top_quaternion: tuple[float, float, float, float] = number(
        (1.0, 0.0, 0.0, 0.0), "1", "start attitude of the top section, scalar first; all zero: as it hangs", min=-1.0, max=1.0
    )
    top_range: float = number(0.0, "m", "how far the top moves to and from the foot: the mesh suits all of it", min=0.0)
    top_amplitude: float = number(0.0, "m", "amplitude with which the top oscillates: the mesh suits the waves it sends", min=0.0)
    section: Section = field(default_factory=Section, metadata={"doc": "the section, where there is one"})
    sections: tuple[Section, ...] = field(default=(), metadata={"doc": "sections from foot to top, instead of `section`"})
    internal_damping: float = number(
        0.0, "s", "Kelvin-Voigt time: viscous section forces are this times C strain rate", min=0.0, usual=(0.0, 1.0)
    )
    numerical_damping: float = number(0.0, "1", "algorithmic dissipation: 0 none, 0.5 backward Euler on the strains", min=0.0, max=0.5)
    max_substeps: int = number(1, "1", "parts of a step that does not converge, a power of 3: for hosts without rollback", min=1, max=729)
    reference_force: Vector3 = number((0.0, 0.0, 0.0), "N", "from which force_change counts, in e: an export's pull at rest")
    reference_moment: Vector3 = number((0.0, 0.0, 0.0), "N.m", "from which moment_change counts, in e: an export's pull at rest")
    added_mass: AddedMass | None = field(default=None, metadata={"doc": "switches on added mass across the section"})
    seabed: Seabed | None = field(default=None, metadata={"doc": "switches on the bed at z = 0"})
    environment: Environment = field(default_factory=Environment, metadata={"doc": "sea and gravity"})

    def __post_init__(self) -> None:
        check_fields(self)
        if self.max_substeps not in _SUBSTEPS:
            raise ValueError(f"max_substeps = {self.max_substeps}: must be one of {', '.join(map(str, _SUBSTEPS))}")
        if not self.sections and self.section.length not in (None, self.length):
            raise ValueError(f"section.length = {self.section.length:g}: must be absent, or the pipe's length {self.length:g} m")
        if self.sections:
            for i, section in enumerate(self.sections, 1):
                if section.length is None:
                    raise ValueError(f"sections[{i}].length: must be given")
            total = sum(section.length or 0.0 for section in self.sections)
            if abs(total - self.length) > 1e-9 * self.length:
                raise ValueError(f"length = {self.length:g}: must equal the sum of the sections' lengths, {total:g} m")
        if self.nodes_at:
            self._check_nodes()
        self._check_reach()
        if self.seabed is not None and not max(self.bearing()) > 0.0:
            rule = "must be given where no section is heavier or lighter than water"
            raise ValueError(f"seabed.reference_weight = nothing: {rule}")
        norm = math.hypot(*self.top_quaternion)
        if norm > 0.0 and abs(norm - 1.0) > 1e-6:
            raise ValueError(f"top_quaternion = {self.top_quaternion!r}: must have length 1, or be all zero")

    def _check_reach(self) -> None:
        distance, depth = math.hypot(*self.top_position[:2]), self.top_position[2]
        if (span := math.hypot(distance, depth)) > self.longest:
            rule = f"must be at least {span / (1.0 + MOST_STRETCH):.6g} m, or the line is stretched by more than {MOST_STRETCH:.0%}"
            raise ValueError(f"length = {self.length:g}: {rule} to the distance from foot to top, {span:.6g} m")
        if math.hypot(distance + self.top_range, depth) > self.longest:
            reach = math.sqrt(self.longest**2 - depth**2) - distance
            rule = f"must be at most {reach:.6g} m, where the line is stretched by {MOST_STRETCH:.0%}"
            raise ValueError(f"top_range = {self.top_range:g}: {rule}")

    def _check_nodes(self) -> None:
        at = self.nodes_at
        if len(at) != self.nodes:
            rule = f"must be the number of entries of nodes_at, {len(at)}; an empty one places the nodes anew"
            raise ValueError(f"nodes = {self.nodes}: {rule}")
        if at[0] != 0.0 or at[-1] != self.length or any(b <= a for a, b in pairwise(at)):
            rule = f"must ascend from 0 to the length {self.length:g} m; an empty one places the nodes anew"
            raise ValueError(f"nodes_at = ({at[0]:g}, ..., {at[-1]:g}): {rule}")

    @property
    def longest(self) -> float:
        """Largest distance from foot to top [m]."""
        return (1.0 + MOST_STRETCH) * self.length

    def weight(self, section: Section) -> float:
        """Submerged weight per length [N/m] of a section."""
        return (section.mass_per_length - self.environment.water_density * section.outer_area) * self.environment.gravity

    def bearing(self) -> tuple[float, ...]:
        """Weight per length [N/m] of every section from which the bed's stiffness under it follows.

        It is the reference weight, or the section's own; for a section that floats, that of the heaviest (of the lightest, if all float).
        """
        weights = [self.weight(section) for section in self.all_sections]
        given = None if self.seabed is None else self.seabed.reference_weight
        heaviest = max(weights) if max(weights) > 0.0 else -min(weights)
        return tuple(given or (own if own > 0.0 else heaviest) for own in weights)

    @property
    def all_sections(self) -> tuple[Section, ...]:
        """The sections from foot to top, each with its length."""
        return self.sections or (self.section,)


def _given(value: float | None, computed: float) -> float:
    return computed if value is None else value
