"""Geometrically exact submerged pipe as a co-simulation unit.

`Pipe` computes, `PipeUnit` names the ports. Modules, from the facade down:
slave (substeps), pipe, model (mesh, catenary), wall_stress, section_forces (end_forces), energy, statics (relaxation, static_balance,
stability, static_kernel), integrator (newton, step_kernel, element_kernel, node_kernel), ends, loads (weight, drag, bed),
element (geometric_stiffness, relative_rotation), assembly, block_tridiagonal, so3, and the lanes that they work in
(columns, lane_arrays, lanes).
"""

from .loads import Seabed
from .model import resolve
from .parameters import AddedMass, PipeParameters, Section
from .pipe import Pipe
from .slave import PipeUnit

__all__ = ["AddedMass", "Pipe", "PipeParameters", "PipeUnit", "Seabed", "Section", "resolve"]
