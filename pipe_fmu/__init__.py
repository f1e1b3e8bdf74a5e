"""Geometrically exact submerged pipe as a co-simulation unit.

`Pipe` computes, `PipeUnit` names the ports. From the facade down, and nothing imports upwards:
slave, substeps, pipe; model, mesh; results; statics, step; line; loads; element; maths, simd.
"""

from .loads import Seabed
from .model import resolve
from .parameters import AddedMass, PipeParameters, Section
from .pipe import Pipe
from .slave import PipeUnit

__all__ = ["AddedMass", "Pipe", "PipeParameters", "PipeUnit", "Seabed", "Section", "resolve"]
