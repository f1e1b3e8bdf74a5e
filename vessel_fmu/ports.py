"""Ports of the vessel as a unit: names, sizes, units of measure, and the ranges of outputs."""

import math

from .dp_controller import holds_for_good
from .parameters import VesselParameters, values

Port = tuple[int, str | tuple[str, ...], str]  # size, unit or those of the components, description
WORKS = ("bond_work", "control_work", "environment_work", "current_work", "damping_dissipation", "drag_dissipation")
_THRUST = ("N", "N", "N.m")
_MOBILITY = 3 * (3 * ("m/(N.s)",) + 3 * ("1/(N.s)",)) + 3 * (3 * ("rad/(N.s)",) + 3 * ("rad/(N.m.s)",))
_AT_LEAST_ZERO = ("kinetic_energy", "restoring_energy", "damping_dissipation", "drag_dissipation")
INPUTS: dict[str, Port] = {
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
OUTPUTS: dict[str, Port] = {
    "hold_energy": (1, "J", "potential of the constant hold thrust where no controller ever takes over"),
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
RANGES: dict[str, tuple[float | None, float | None]] = {
    **dict.fromkeys(_AT_LEAST_ZERO, (0.0, None)),
    "roll": (-math.pi, math.pi),
    "pitch": (-0.5 * math.pi, 0.5 * math.pi),
    "yaw": (-math.pi, math.pi),
}


def outputs(parameters: VesselParameters) -> dict[str, Port]:
    """Output ports of a vessel with these parameters: all, hold_energy only where a hold thrust pushes for good."""
    held = holds_for_good(values(parameters))
    return {name: port for name, port in OUTPUTS.items() if held or name != "hold_energy"}
