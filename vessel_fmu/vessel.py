"""The vessel as a whole: states as values, and the step as a function of them, by the kernels that the unit runs."""

from typing import NamedTuple

import numpy as np

from . import native, pose
from .attitude import Array, along_heading, angles_from_quaternion, rotation_matrix
from .dp_controller import HOLD, ControlState, control_law, controlled, hold_energy, remembered
from .hydrodynamics import add_drag, add_restoring, hull_constants, restoring_energy, surface_current
from .notes import blank, texts
from .parameters import VesselParameters
from .ports import INPUTS
from .rigid_body import kinetic_energy

ZERO3 = np.zeros(3)


class Inputs(NamedTuple):
    """What acts on the vessel, held over the step."""

    force: Array = ZERO3  # N in e, of the pipe at the hang-off point
    moment: Array = ZERO3  # N m in e, the same
    control_force: Array = ZERO3  # surge, sway in b, N; yaw, N m, of a controller outside
    environment_force: Array = ZERO3  # N in e, at the centre of gravity
    environment_moment: Array = ZERO3  # N m in e
    environment_force_b: Array = ZERO3  # N in b, at the centre of gravity
    environment_moment_b: Array = ZERO3  # N m in b


class State(NamedTuple):
    """State of the vessel with the means of the step that led to it, the parts of native.STATE; values are never mutated."""

    position: Array  # (3,)
    quaternion: Array  # (4,)
    body_velocity: Array  # (6,)
    mean_velocity: Array  # (6,)
    mobility: Array  # (6, 6)
    works: Array  # (6,)
    control: ControlState


class Step(NamedTuple):
    """Outcome of a step; without convergence `state` is the one before it."""

    state: State
    converged: bool
    message: str  # what Newton left, without convergence


class Vessel:
    """The model of one vessel; holds constants only."""

    def __init__(self, parameters: VesselParameters) -> None:
        self.parameters = parameters
        self.depth = parameters.environment.depth
        self.constants = native.constants(parameters)
        self.hull = hull_constants(self.constants)
        self.law = control_law(self.constants)

    def start(self) -> State:
        """State at the start: pose and velocity of the parameters, hold thrust, and the mobility zero of a step of no length."""
        return from_vector(native.started(self.parameters)[0])

    def step(self, state: State, time: float, h: float, inputs: Inputs) -> Step:
        """Step of length h, s, from `time`, s; discretely passive for any h. Raises ValueError for h <= 0."""
        if not h > 0.0:
            raise ValueError(f"h = {h}: must be > 0 s")
        given, after = np.concatenate([getattr(inputs, name, ZERO3) for name in INPUTS]), np.empty(native.N_STATE)
        notes = blank()
        if native.unit_step(self.constants, given, float(time), float(h), to_vector(state), after, notes) != 0:
            return Step(state, False, texts(notes, native.MESSAGES)[0])
        return Step(from_vector(after), True, "")

    def control(self, state: State, time: float) -> ControlState:
        """Memory of the controller with the thrust that acts from `time`, s, on."""
        return controlled(self.law, state.control, float(time), state.position, state.quaternion, state.body_velocity)

    def surface_current(self, time: float) -> Array:
        """Current velocity (3,), m/s in e, at the surface."""
        return surface_current(self.constants, float(time))

    def position(self, state: State) -> Array:
        """Centre of gravity (3,), m in e."""
        return pose.centre(self.constants, state.position)

    def thrust(self, state: State) -> Array:
        """Thrust (3,) of the own controller or hold along the heading: surge, sway, N; yaw, N m."""
        return along_heading(angles_from_quaternion(state.quaternion)[2], state.control.thrust)

    def kinetic_energy(self, state: State) -> float:
        """Kinetic energy, J, of hull and added mass."""
        return kinetic_energy(self.hull.mass, state.body_velocity)

    def restoring_energy(self, state: State) -> float:
        """Potential of the restoring, J."""
        return restoring_energy(self.hull.stiffness, self.hull.flotation, state.position[2], rotation_matrix(state.quaternion))

    def hold_energy(self, state: State) -> float:
        """Potential, J, of a thrust that holds for good, zero at the start."""
        return hold_energy(self.constants, state.position)

    def hang_off_pose(self, position: Array, quaternion: Array) -> tuple[Array, Array]:
        """Hang-off point (3,), m in e, and orientation (4,) t to e of the pipe section held there."""
        return pose.hang_off_pose(self.constants, position, quaternion)

    def hang_off_velocity(self, quaternion: Array, nu: Array) -> Array:
        """Velocity, m/s, and angular velocity, rad/s, of the hang-off point, (6,) in e, for a body velocity nu (6,)."""
        return pose.hang_off_velocity(self.constants, quaternion, nu)

    def moment_about_centre(self, quaternion: Array, force: Array, moment: Array) -> Array:
        """Moment (3,), N m in e, about the centre of gravity of a force and a moment at the hang-off point."""
        return pose.moment_about_centre(self.constants, quaternion, force, moment)

    def static_load(self, position: Array, quaternion: Array, current: Array = ZERO3) -> tuple[Array, Array]:
        """Force, N, and moment, N m, (3,) in e at the centre of gravity, on the hull at rest without the pipe's pull.

        Restoring, hold thrust and drag of a surface current (3,), m/s in e; position (3,), m in e. Equilibrium: with
        the pull and its `moment_about_centre` they sum to zero.
        """
        rotation = rotation_matrix(quaternion)
        relative = np.concatenate([-(rotation.T @ current), ZERO3])
        load = self.hull.damping @ relative
        add_drag(self.hull.surge_drag, self.hull.strips, relative, load)
        down = rotation[2]
        add_restoring(self.hull.stiffness, self.hull.flotation, position[2] + self.depth, down, down, np.zeros(6), 0.0, load)
        x, y, yaw = self.constants[HOLD]
        return [x, y, 0.0] - rotation @ load[:3], [0.0, 0.0, yaw] - rotation @ load[3:]


def to_vector(state: State) -> Array:
    """The vector of a state, with nothing said of it."""
    return np.concatenate([*(np.ravel(part) for part in (*state[:-1], *state.control)), np.zeros(native.STATE["told"])])


def from_vector(vector: Array) -> State:
    """The state that a vector holds."""
    found = {name: vector[getattr(native.AT, name)] for name in State._fields}
    return State(**found | {"mobility": found["mobility"].reshape(6, 6), "control": remembered(found["control"])})
