"""The unit as four kernels on plain vectors: constants, start, step, outputs; no Python in them.

The constants are the `values` of the parameters, which the kernels read by `place`. Each kernel takes contiguous vectors,
fills the last ones, and answers 0, or 2 where a step is not done, 3 where a value is refused; `notes` say why, and what else
there is to say. The same code runs below Python and, compiled ahead, in an FMU without it.
"""

from typing import get_args, get_type_hints

import numpy as np

from .attitude import Array, along_heading, angles_from_quaternion, fill, quaternion_from_angles, rotation_matrix
from .compiled import kernel
from .dp_controller import (
    HOLD,
    MEMORY,
    control_law,
    controlled,
    hold_energy,
    holds_for_good,
    initial_control,
    remember,
    remembered,
    with_pull,
)
from .environment import Current
from .hydrodynamics import hull_constants, restoring_energy, surface_current
from .integrator import ROUND_OFF, advance
from .notes import DISCARD, ERROR, add_note, blank, texts
from .parameters import SURFACE_FACTOR, VesselParameters, place, values
from .ports import INPUTS, OUTPUTS, WORKS, outputs
from .pose import centre, hang_off_pose, hang_off_velocity, moment_about_centre
from .rigid_body import kinetic_energy
from .rules import ADDS_PORT, CHANGES_PORT, TABLE, refused_added_mass, refused_damping, refused_limits, refused_ratio
from .validity import MESSAGES as REMARKS
from .validity import look, look_at_parameters
from .vectors import numbers, parts, total

MESSAGES = (*REMARKS, "vessel: Newton stopped at a relative unbalance of %.1e after %d iterations")
NOT_CONVERGED = float(len(REMARKS))
N_GROUPS = 1  # of outputs that are computed at once
STATE = {
    "position": 3,  # m, x and y in e, z counted from the heave equilibrium (keeps round-off of the energy small)
    "quaternion": 4,  # b to e
    "body_velocity": 6,  # m/s, rad/s
    "mean_velocity": 6,  # at the hang-off point, in e, over the last step
    "mobility": 36,  # dV/dF of the last step, row-major
    "works": len(WORKS),  # J since the start
    "control": MEMORY,
    "told": 2,  # what was said of roll and pitch
}
N_CONSTANTS, N_STATE = SURFACE_FACTOR + 1, total(STATE)
N_INPUTS, N_OUTPUTS = (sum(size for size, _, _ in ports.values()) for ports in (INPUTS, OUTPUTS))
AT = parts(STATE)
IN, OUT = (parts({name: size for name, (size, _, _) in ports.items()}) for ports in (INPUTS, OUTPUTS))
WORK = slice(OUT.bond_work.start, OUT.drag_dissipation.stop)  # in the order of WORKS
HOLD_ENERGY, CONTROL_WORK, KINETIC, RESTORING, ROLL, PITCH, YAW = (
    getattr(OUT, name).start for name in ("hold_energy", "control_work", "kinetic_energy", "restoring_energy", "roll", "pitch", "yaw")
)
DAMPING, MASS, INERTIA, ADDED_MASS = place("damping"), place("mass"), place("inertia"), place("added_mass")
POSITION, ATTITUDE = place("start.position"), place("start.attitude")
VELOCITY, ANGULAR_VELOCITY, DEPTH = place("start.velocity"), place("start.angular_velocity"), place("environment.depth")
DAMPING_RATIO, INTEGRAL_RATIO = place("controller.damping_ratio"), place("controller.integral_ratio")
PROFILE, TABULATED = place("environment.current.profile"), 1.0 + get_args(get_type_hints(Current)["profile"]).index("table")


@kernel
def unit_constants(exported: Array, values: Array, constants: Array, notes: Array) -> int:
    """Fill `constants` (n,) with those of the parameters' `values` (n,); 3 and a note where these break a rule.

    `exported` are the constants that the unit was made with: tables and ports stay those of the export.
    """
    notes[0] = 0.0
    if (
        refused_damping(values[DAMPING], notes)
        or refused_ratio(values[DAMPING_RATIO], values[INTEGRAL_RATIO], notes)
        or refused_added_mass(values[MASS], values[INERTIA], values[ADDED_MASS], notes)
        or refused_limits(values[HOLD], values[ATTITUDE][2], control_law(values).limit, notes)
    ):
        return int(ERROR)
    if values[PROFILE] == TABULATED and exported[PROFILE] != TABULATED:
        add_note(notes, ERROR, TABLE, 0.0, 0.0, 0.0)
        return int(ERROR)
    if holds_for_good(values) != holds_for_good(exported):
        add_note(notes, ERROR, CHANGES_PORT if holds_for_good(exported) else ADDS_PORT, 0.0, 0.0, 0.0)
        return int(ERROR)
    fill(constants, values)
    return 0


@kernel
def unit_start(constants: Array, exported: Array, exported_state: Array, inputs: Array, time: float, state: Array, notes: Array) -> int:
    """Fill `state` with the pose, velocity and hold thrust of the parameters and the mobility zero of a step of no length; never fails."""
    notes[0] = 0.0
    for i in range(N_STATE):
        state[i] = 0.0
    position, attitude, quaternion, nu = state[AT.position], constants[ATTITUDE], state[AT.quaternion], state[AT.body_velocity]
    fill(position, constants[POSITION])
    position[2] += constants[DEPTH]
    fill(quaternion, quaternion_from_angles(attitude[0], attitude[1], attitude[2]))
    fill(nu[:3], constants[VELOCITY])
    fill(nu[3:], constants[ANGULAR_VELOCITY])
    fill(state[AT.mean_velocity], hang_off_velocity(constants, quaternion, nu))
    pose = position.copy()
    pose[2] = attitude[2]
    remember(initial_control(constants[HOLD], pose), state[AT.control])
    look_at_parameters(constants, notes)
    look(quaternion, state[AT.told], notes)
    return 0


@kernel
def unit_step(constants: Array, inputs: Array, time: float, h: float, state: Array, after: Array, notes: Array) -> int:
    """Fill `after` with the state a step h, s, from `time`, s, leads to; 2 and a note, `after` untouched, if Newton did not converge."""
    notes[0] = 0.0
    hull, law = hull_constants(constants), control_law(constants)
    position, quaternion, nu = state[AT.position], state[AT.quaternion], state[AT.body_velocity]
    control = controlled(law, remembered(state[AT.control]), time, position, quaternion, nu)
    loads = np.empty((9, 3))
    for i in range(3):
        loads[0, i] = inputs[IN.force][i] + inputs[IN.force_change][i]
        loads[1, i] = inputs[IN.moment][i] + inputs[IN.moment_change][i]
        loads[2, i] = control.thrust[i]
        loads[3, i] = inputs[IN.control_force][i]
        loads[4, i] = inputs[IN.environment_force][i]
        loads[5, i] = inputs[IN.environment_moment][i]
        loads[7, i] = inputs[IN.environment_force_b][i]
        loads[8, i] = inputs[IN.environment_moment_b][i]
    fill(loads[6], surface_current(constants, time + 0.5 * h))
    moved, turned, velocity, mean_velocity, mobility, works, iterations, residual = advance(hull, position, quaternion, nu, loads, h)
    if not residual < ROUND_OFF:
        add_note(notes, DISCARD, NOT_CONVERGED, 2.0, residual, float(iterations))
        return int(DISCARD)
    pull = loads[0].copy()
    pull[2] = moment_about_centre(constants, quaternion, loads[0], loads[1])[2]
    remember(with_pull(law, control, pull, h), after[AT.control])
    fill(after[AT.position], moved)
    fill(after[AT.quaternion], turned)
    fill(after[AT.body_velocity], velocity)
    fill(after[AT.mean_velocity], mean_velocity)
    for i in range(6):
        after[AT.works][i] = state[AT.works][i] + works[i]
        fill(after[AT.mobility][6 * i : 6 * i + 6], mobility[i])
    fill(after[AT.told], state[AT.told])
    look(after[AT.quaternion], after[AT.told], notes)
    return 0


@kernel
def unit_outputs(constants: Array, state: Array, group: int, outputs: Array) -> None:
    """Fill `outputs` with the values of the ports in `state`; all are of one group."""
    hull, control = hull_constants(constants), remembered(state[AT.control])
    position, quaternion, nu = state[AT.position], state[AT.quaternion], state[AT.body_velocity]
    point, (roll, pitch, yaw) = centre(constants, position), angles_from_quaternion(quaternion)
    top, held = hang_off_pose(constants, point, quaternion)
    end, held_energy = hang_off_velocity(constants, quaternion, nu), hold_energy(constants, position)
    fill(outputs[OUT.velocity], state[AT.mean_velocity][:3])
    fill(outputs[OUT.angular_velocity], state[AT.mean_velocity][3:])
    fill(outputs[OUT.end_velocity], end[:3])
    fill(outputs[OUT.end_angular_velocity], end[3:])
    fill(outputs[OUT.mobility], state[AT.mobility])
    fill(outputs[OUT.hang_off_position], top)
    fill(outputs[OUT.hang_off_quaternion], held)
    fill(outputs[OUT.position], point)
    fill(outputs[OUT.quaternion], quaternion)
    outputs[ROLL], outputs[PITCH], outputs[YAW] = roll, pitch, yaw
    fill(outputs[OUT.body_velocity], nu)
    fill(outputs[OUT.set_point], control.reference[0])
    fill(outputs[OUT.thrust], along_heading(yaw, control.thrust))
    outputs[KINETIC] = kinetic_energy(hull.mass, nu)
    outputs[RESTORING] = restoring_energy(hull.stiffness, hull.flotation, position[2], rotation_matrix(quaternion))
    fill(outputs[WORK], state[AT.works])
    outputs[CONTROL_WORK] += held_energy  # less what the hold's potential holds
    outputs[HOLD_ENERGY] = held_energy


def constants(parameters: VesselParameters) -> Array:
    """Constants (n,) of a unit with these parameters."""
    return values(parameters)


def value_places(parameters: VesselParameters) -> dict[str, int]:
    """Places in the values of the parameters that a host may change, by name; the profile of a tabulated current stays."""
    current = parameters.environment.current
    fixed = "environment.current.profile" if current is not None and current.profile == "table" else ""
    return {it.name: i for i, it in enumerate(numbers(VesselParameters, parameters)) if not np.isnan(it.value) and it.name != fixed}


def output_places(parameters: VesselParameters) -> dict[str, tuple[slice, int]]:
    """Slice of the outputs and group of each output port."""
    return {name: (getattr(OUT, name), 0) for name in outputs(parameters)}


def started(parameters: VesselParameters) -> tuple[Array, list[str]]:
    """State (n,) of a unit at its start, and what it says of it, a line each."""
    given, state, notes = constants(parameters), np.empty(N_STATE), blank()
    unit_start(given, given, state, np.zeros(N_INPUTS), 0.0, state, notes)
    return state, texts(notes, MESSAGES)
