"""The vessel as a co-simulation unit: ports by name, snapshots as references. Knows nothing of FMI."""

import math
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from . import validity
from .attitude import Array, angles_from_quaternion
from .parameters import VesselParameters
from .vessel import WORKS, Inputs, State, Vessel

Port = tuple[int, str | tuple[str, ...], str]  # size, unit or those of the components, description
_THRUST = ("N", "N", "N.m")
_MOBILITY = 3 * (3 * ("m/(N.s)",) + 3 * ("1/(N.s)",)) + 3 * (3 * ("rad/(N.s)",) + 3 * ("rad/(N.m.s)",))
_AT_LEAST_ZERO = ("kinetic_energy", "restoring_energy", "damping_dissipation", "drag_dissipation")


class VesselUnit:
    """Six-degree-of-freedom vessel with hang-off point; `state` is an immutable value, so that saving it costs nothing."""

    NAME = "vessel"
    DESCRIPTION = "Surface vessel in six degrees of freedom, discretely passive, with optional dynamic positioning"
    PARAMETERS = VesselParameters
    INPUTS: ClassVar[dict[str, Port]] = {
        "force": (3, "N", "force of the pipe on the vessel at the hang-off point, in e, held over the step"),
        "moment": (3, "N.m", "moment of the pipe on the vessel at the hang-off point, in e, held over the step"),
        "force_change": (3, "N", "added to force: change of the pipe's pull, where force keeps its start value"),
        "moment_change": (3, "N.m", "added to moment: change of the pipe's pull, where moment keeps its start value"),
        "control_force": (3, _THRUST, "external controller: surge and sway force in b, and yaw moment"),
        "environment_force": (3, "N", "environmental force at the centre of gravity, in e: keeps its direction where the hull turns"),
        "environment_moment": (3, "N.m", "environmental moment, in e"),
        "environment_force_b": (3, "N", "environmental force at the centre of gravity, in b: turns with the hull; added to that in e"),
        "environment_moment_b": (3, "N.m", "environmental moment, in b; added to that in e"),
    }
    RANGES: ClassVar[dict[str, tuple[float | None, float | None]]] = {
        **dict.fromkeys(_AT_LEAST_ZERO, (0.0, None)),
        "roll": (-math.pi, math.pi),
        "pitch": (-0.5 * math.pi, 0.5 * math.pi),
        "yaw": (-math.pi, math.pi),
    }

    def __init__(self, parameters: VesselParameters) -> None:
        self.vessel = Vessel(parameters)
        self._start = (self.vessel.start(), validity.QUIET)
        self._state = self._start
        self._memo: dict[str, Array] = {}
        self.remark = ""  # what the host's log should say of the start, or of the last step that was done; a line each

    @staticmethod
    def outputs(parameters: VesselParameters) -> dict[str, Port]:
        """Output ports: name -> (size, unit, description)."""
        without = parameters.controller is None and any(parameters.hold_force[:2])
        hold = {"hold_energy": (1, "J", "potential of the constant hold thrust where no controller ever takes over")} if without else {}
        return hold | {
            "velocity": (3, "m/s", "mean velocity of the hang-off point over the last step, in e"),
            "angular_velocity": (3, "rad/s", "rotation vector of the last step over its length, in e"),
            "end_velocity": (3, "m/s", "velocity of the hang-off point at the end of the step, in e"),
            "end_angular_velocity": (3, "rad/s", "angular velocity at the end of the step, in e"),
            "mobility": (36, _MOBILITY, "row-major response of (velocity, angular_velocity) to (force, moment), last step"),
            "hang_off_position": (3, "m", "hang-off point, in e"),
            "hang_off_quaternion": (4, "1", "orientation of the pipe section held there, t to e, scalar first"),
            "position": (3, "m", "centre of gravity, in e"),
            "quaternion": (4, "1", "attitude, b to e, scalar first"),
            "roll": (1, "rad", "roll angle (zyx)"),
            "pitch": (1, "rad", "pitch angle (zyx)"),
            "yaw": (1, "rad", "yaw angle (zyx)"),
            "body_velocity": (6, 3 * ("m/s",) + 3 * ("rad/s",), "linear and angular velocity of the centre of gravity in b"),
            "set_point": (3, ("m", "m", "rad"), "set-point after the reference filter: x, y, yaw"),
            "thrust": (3, _THRUST, "own thrust along the heading, hold included: surge, sway, yaw"),
            "kinetic_energy": (1, "J", "kinetic energy of hull and added mass"),
            "restoring_energy": (1, "J", "potential of the hydrostatic restoring"),
            "bond_work": (1, "J", "work done on the vessel at the hang-off point since the start"),
            "control_work": (1, "J", "work of the hold thrust, the own and the external controller since the start"),
            "environment_work": (1, "J", "work of the environmental forces and moments since the start"),
            "current_work": (1, "J", "work supplied by the current since the start"),
            "damping_dissipation": (1, "J", "energy taken by the linear damping since the start"),
            "drag_dissipation": (1, "J", "energy taken by the quadratic drag since the start"),
        }

    @staticmethod
    def nominal(parameters: VesselParameters) -> dict[str, float]:
        """Orders of magnitude by unit of measure: 1 m/s reached in 10 s, turns about the radius of gyration in yaw, the depth."""
        mass, arm = parameters.mass, math.sqrt(parameters.inertia[2] / parameters.mass)
        force = 0.1 * mass
        return {"m": parameters.environment.depth, "m/s": 1.0, "rad": 0.1, "rad/s": 1.0 / arm, "N": force, "N.m": force * arm, "J": mass}

    def initialize(self, time: float, inputs: dict[str, Array]) -> str | None:
        """Take the pose, velocity and hold thrust of the parameters; never fails."""
        self.state = self._start
        self.remark = "\n".join([*validity.of_parameters(self.vessel.parameters), *self._look()])
        return None

    def _look(self) -> list[str]:
        """Remarks on the present attitude, if it is beyond a limit by more than was said; remembers in the state what it says."""
        state, told = self._state
        words, told = validity.look(state, told)
        if words:
            self.state = (state, told)
        return words

    def step(self, time: float, h: float, inputs: dict[str, Array]) -> str | None:
        """Step from `time`, s, by h, s; a message and the state unchanged if Newton did not converge."""
        force, moment = inputs["force"] + inputs["force_change"], inputs["moment"] + inputs["moment_change"]
        loads = Inputs(force, moment, **{name: inputs[name] for name in Inputs._fields[2:]})
        result = self.vessel.step(self._state[0], time, h, loads)
        if not result.converged:
            return f"vessel: Newton stopped at a relative unbalance of {result.residual:.1e} after {result.iterations} iterations"
        self.state = (result.state, self._state[1])
        self.remark = "\n".join(self._look())
        return None

    @property
    def state(self) -> tuple[State, Array]:
        """The state, and what was said of it; setting it restores everything exactly."""
        return self._state

    @state.setter
    def state(self, value: Any) -> None:
        self._state = value
        self._memo = {}

    def output(self, name: str) -> Array:
        """Value (size,) of an output port in the present state. Raises KeyError for an unknown name."""
        if name not in self._memo:
            self._memo.update(self._evaluate(name))
        return self._memo[name]

    def _evaluate(self, name: str) -> dict[str, Array]:
        state, vessel = self._state[0], self.vessel
        if name in WORKS:
            works = {work: state.works[i : i + 1] for i, work in enumerate(WORKS)}
            return works | {"control_work": works["control_work"] + vessel.hold_energy(state)}  # less what the hold's potential holds
        if name in ("velocity", "angular_velocity"):
            return {"velocity": state.mean_velocity[:3], "angular_velocity": state.mean_velocity[3:]}
        if name in ("end_velocity", "end_angular_velocity"):
            end = vessel.hang_off_velocity(state.quaternion, state.body_velocity)
            return {"end_velocity": end[:3], "end_angular_velocity": end[3:]}
        if name in ("hang_off_position", "hang_off_quaternion"):
            point, quaternion = vessel.hang_off_pose(vessel.position(state), state.quaternion)
            return {"hang_off_position": point, "hang_off_quaternion": quaternion}
        if name in ("roll", "pitch", "yaw"):
            return {n: np.array([v]) for n, v in zip(("roll", "pitch", "yaw"), angles_from_quaternion(state.quaternion), strict=True)}
        return {name: _VALUES[name](vessel, state)}


_VALUES: dict[str, Callable[[Vessel, State], Array]] = {
    "mobility": lambda vessel, state: state.mobility.ravel(),
    "position": lambda vessel, state: vessel.position(state),
    "quaternion": lambda vessel, state: state.quaternion,
    "body_velocity": lambda vessel, state: state.body_velocity,
    "set_point": lambda vessel, state: state.control.reference[0],
    "thrust": lambda vessel, state: vessel.thrust(state),
    "kinetic_energy": lambda vessel, state: np.array([vessel.kinetic_energy(state)]),
    "hold_energy": lambda vessel, state: np.array([vessel.hold_energy(state)]),
    "restoring_energy": lambda vessel, state: np.array([vessel.restoring_energy(state)]),
}
