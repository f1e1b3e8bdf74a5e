"""Six-degree-of-freedom vessel as a co-simulation unit.

`Vessel` computes with states as values, `VesselUnit` with ports and one vector; both run the kernels of `native`. Modules, from the
facade down: slave, vessel, native, validity, ports, integrator, dp_controller, pose, hydrodynamics, parameters, rules, rigid_body, notes,
vectors, attitude, compiled, environment, checks.
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
