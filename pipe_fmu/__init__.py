"""Geometrically exact submerged pipe as a co-simulation unit.

`Pipe` computes, `PipeUnit` names the ports. Modules, from the facade down:
slave, pipe, model (mesh, catenary), statics (relaxation, static_balance, stability), integrator (newton,
step_kernel, node_kernel, static_kernel), loads (static_drag, hydrodynamics, seabed), recovery, energy, element, assembly,
block_tridiagonal, so3.
"""

from .model import resolve
from .parameters import AddedMass, PipeParameters, Seabed, Section
from .pipe import Pipe
from .slave import PipeUnit

__all__ = ["AddedMass", "Pipe", "PipeParameters", "PipeUnit", "Seabed", "Section", "resolve"]
