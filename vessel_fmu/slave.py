"""The vessel as a co-simulation unit: ports by name, snapshots as references. Knows nothing of FMI."""

import math
from typing import ClassVar

import numpy as np

from . import native, ports
from .attitude import Array
from .notes import blank, texts
from .parameters import VesselParameters


class VesselUnit:
    """Six-degree-of-freedom vessel with hang-off point; `state` is one vector that is never mutated, so that saving it costs nothing."""

    NAME = "vessel"
    DESCRIPTION = "Surface vessel in six degrees of freedom, discretely passive, with optional dynamic positioning"
    PARAMETERS = VesselParameters
    INPUTS: ClassVar[dict[str, ports.Port]] = ports.INPUTS
    RANGES: ClassVar[dict[str, tuple[float | None, float | None]]] = ports.RANGES
    outputs = staticmethod(ports.outputs)

    def __init__(self, parameters: VesselParameters) -> None:
        self.parameters = parameters
        self.constants = native.constants(parameters)
        self._places = native.output_places(parameters)
        self._notes = blank()
        self._start, self._said_of_it = native.started(parameters)
        self.state, self.remark = self._start, ""  # what the host's log should say of the start, or of the last step that was done

    @staticmethod
    def nominal(parameters: VesselParameters) -> dict[str, float]:
        """Orders of magnitude by unit of measure: 1 m/s reached in 10 s, turns about the radius of gyration in yaw, the depth."""
        mass, arm = parameters.mass, math.sqrt(parameters.inertia[2] / parameters.mass)
        force = 0.1 * mass
        return {"m": parameters.environment.depth, "m/s": 1.0, "rad": 0.1, "rad/s": 1.0 / arm, "N": force, "N.m": force * arm, "J": mass}

    def compile(self) -> None:
        """Run every kernel once."""
        notes, state, given = blank(), self.state.copy(), np.zeros(native.N_INPUTS)
        native.unit_constants(self.constants, native.values(self.parameters), np.empty_like(self.constants), notes)
        native.unit_start(self.constants, self.constants, self.state, given, 0.0, state, notes)
        native.unit_step(self.constants, given, 0.0, 1e-3, state, np.empty_like(state), notes)
        native.unit_outputs(self.constants, state, 0, np.empty(native.N_OUTPUTS))

    def initialize(self, time: float, inputs: dict[str, Array]) -> str | None:
        """Take the pose, velocity and hold thrust of the parameters; never fails."""
        self.state, self.remark = self._start, "\n".join(self._said_of_it)
        return None

    def step(self, time: float, h: float, inputs: dict[str, Array]) -> str | None:
        """Step from `time`, s, by h, s; a message and the state unchanged if Newton did not converge."""
        given, after = np.concatenate([inputs[name] for name in self.INPUTS]), np.empty(native.N_STATE)
        status = native.unit_step(self.constants, given, time, h, self.state, after, self._notes)
        said = "\n".join(texts(self._notes, native.MESSAGES))
        if status != 0:
            return said
        self.state, self.remark = after, said
        return None

    @property
    def state(self) -> Array:
        """The state (n,), and what was said of it; setting it restores everything exactly."""
        return self._state

    @state.setter
    def state(self, value: Array) -> None:
        self._state = value
        self._outputs: Array | None = None

    def output(self, name: str) -> Array:
        """Value (size,) of an output port in the present state. Raises KeyError for an unknown name."""
        part, group = self._places[name]
        if self._outputs is None:
            self._outputs = np.empty(native.N_OUTPUTS)
            native.unit_outputs(self.constants, self._state, group, self._outputs)
        return self._outputs[part]
