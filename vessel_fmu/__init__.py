"""Six-degree-of-freedom vessel as a co-simulation unit.

`Vessel` computes, `VesselUnit` names the ports. Modules, from the facade down: slave, vessel, integrator, dp_controller,
hydrodynamics, rigid_body, attitude, compiled; parameters, environment, checks.
"""

from .parameters import AddedMass, Controller, HullDrag, LinearDamping, Start, VesselParameters
from .slave import VesselUnit
from .vessel import Inputs, State, Step, Vessel

__all__ = [
    "AddedMass",
    "Controller",
    "HullDrag",
    "Inputs",
    "LinearDamping",
    "Start",
    "State",
    "Step",
    "Vessel",
    "VesselParameters",
    "VesselUnit",
]
