"""Parameters of the pipe; the defaults are a 16 in x 22.2 mm steel pipe of 1200 m, laid empty in 800 m of water."""

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal

from .checks import check_fields, number
from .environment import Environment
from .loads import Seabed
from .rules import MOST_STRETCH, WORDS, refusal
from .section import Section, Vector3, bearing, weight_in_water

__all__ = ["AddedMass", "PipeParameters", "Section"]
End = Literal["clamped", "pinned"]


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
        number, values = refusal(
            float(self.length),
            self.top_position,
            self.top_quaternion,
            self.top_range,
            self.max_substeps,
            1.0 if self.seabed is None else max(self.bearing()),
        )
        if number >= 0:
            words, count = WORDS[number]
            raise ValueError(words % values[:count])

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
        sea = self.environment
        return float(weight_in_water(section.mass_per_length, section.outer_area, sea.water_density, sea.gravity))

    def bearing(self) -> tuple[float, ...]:
        """Weight per length [N/m] of every section from which the bed's stiffness under it follows."""
        weights = [self.weight(section) for section in self.all_sections]
        given = None if self.seabed is None else self.seabed.reference_weight
        return tuple(bearing(own, max(weights), min(weights), math.nan if given is None else given) for own in weights)

    @property
    def all_sections(self) -> tuple[Section, ...]:
        """The sections from foot to top, each with its length."""
        return self.sections or (self.section,)
