"""The vessel as a whole: constants from the parameters, states as values, and the step as a function of them.

Ports refer to the hang-off point r_t; the pipe section held there has the orientation R_t = R_b (R_b^t)^T with R_b^t =
R_y(-alpha), turned further by the departure rotation vector rho in b: R_t = R_b exp(rho) R_y(alpha).
"""

from typing import NamedTuple

import numpy as np

from .attitude import (
    Array,
    add_cross,
    angles_from_quaternion,
    exp_quaternion,
    multiply,
    quaternion_from_angles,
    rotation_matrix,
)
from .dp_controller import ControlState, control_law, due_sample, heading, initial_control, sampled, with_pull
from .hydrodynamics import add_drag, add_restoring, hull_constants, restoring_energy
from .integrator import ROUND_OFF, advance
from .parameters import VesselParameters
from .rigid_body import kinetic_energy

ZERO3 = np.zeros(3)
WORKS = ("bond_work", "control_work", "environment_work", "current_work", "damping_dissipation", "drag_dissipation")


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
    """State of the vessel with the means of the step that led to it; values are never mutated."""

    position: Array  # (3,) m, x and y in e, z counted from the heave equilibrium (keeps round-off of the energy small)
    quaternion: Array  # (4,) b to e
    body_velocity: Array  # (6,) m/s, rad/s
    mean_velocity: Array  # (6,) at the hang-off point, in e, over the last step
    mobility: Array  # (6, 6) dV/dF of the last step
    works: Array  # (6,) J since the start, in the order of WORKS
    control: ControlState


class Step(NamedTuple):
    """Outcome of a step; without convergence `state` is the one before it."""

    state: State
    converged: bool
    iterations: int
    residual: float  # unbalance left, over the terms that make it up


class Vessel:
    """The model of one vessel; holds constants only."""

    def __init__(self, parameters: VesselParameters) -> None:
        self.parameters = parameters
        self.depth = parameters.environment.depth
        self.current = parameters.environment.current
        self.hull = hull_constants(parameters)
        self.law = control_law(parameters)
        pitched = exp_quaternion(np.array([0.0, 1.0, 0.0]), parameters.departure_angle)
        self.held_section = multiply(exp_quaternion(np.array(parameters.departure_rotation), 1.0), pitched)  # t to b

    def start(self) -> State:
        """State at the start: pose and velocity of the parameters, hold thrust, and the mobility zero of a step of no length."""
        start = self.parameters.start
        position = np.add(start.position, (0.0, 0.0, self.depth))
        quaternion = quaternion_from_angles(*start.attitude)
        nu = np.array([*start.velocity, *start.angular_velocity])
        mean_velocity = self.hang_off_velocity(quaternion, nu)
        pose = np.array([position[0], position[1], start.attitude[2]])
        control = initial_control(np.array(self.parameters.hold_force), pose)
        return State(position, quaternion, nu, mean_velocity, np.zeros((6, 6)), np.zeros(len(WORKS)), control)

    def step(self, state: State, time: float, h: float, inputs: Inputs) -> Step:
        """Step of length h, s, from `time`, s; discretely passive for any h. Raises ValueError for h <= 0."""
        if not h > 0.0:
            raise ValueError(f"h = {h}: must be > 0 s")
        control = self.control(state, time)
        loads = np.array([
            inputs.force,
            inputs.moment,
            control.thrust,
            inputs.control_force,
            inputs.environment_force,
            inputs.environment_moment,
            self.surface_current(time + 0.5 * h),
            inputs.environment_force_b,
            inputs.environment_moment_b,
        ])  # fmt: skip
        position, quaternion, nu, mean_velocity, mobility, works, iterations, residual = advance(
            self.hull, state.position, state.quaternion, state.body_velocity, loads, h
        )
        if not residual < ROUND_OFF:
            return Step(state, False, iterations, residual)
        if self.law is not None:
            moment = self.moment_about_centre(state.quaternion, inputs.force, inputs.moment)
            pull = np.array([inputs.force[0], inputs.force[1], moment[2]])
            control = with_pull(self.law, control, pull, h)
        new = State(position, quaternion, nu, mean_velocity, mobility, state.works + works, control)
        return Step(new, True, iterations, residual)

    def control(self, state: State, time: float) -> ControlState:
        """Memory of the controller with the thrust that acts from `time`, s, on."""
        if self.law is None or (sample := due_sample(self.law, state.control, time)) is None:
            return state.control
        rotation = rotation_matrix(state.quaternion)
        v, w = rotation @ state.body_velocity[:3], rotation @ state.body_velocity[3:]
        pose = np.array([state.position[0], state.position[1], angles_from_quaternion(state.quaternion)[2]])
        return sampled(self.law, state.control, sample, time, pose, np.array([v[0], v[1], w[2]]))

    def surface_current(self, time: float) -> Array:
        """Current velocity (3,), m/s in e, at the surface."""
        return ZERO3 if self.current is None else np.array(self.current.surface_velocity(time, self.depth))

    def position(self, state: State) -> Array:
        """Centre of gravity (3,), m in e."""
        return state.position - [0.0, 0.0, self.depth]

    def thrust(self, state: State) -> Array:
        """Thrust (3,) of the own controller or hold along the heading: surge, sway, N; yaw, N m."""
        return state.control.thrust @ heading(angles_from_quaternion(state.quaternion)[2])

    def kinetic_energy(self, state: State) -> float:
        """Kinetic energy, J, of hull and added mass."""
        return kinetic_energy(self.hull.mass, state.body_velocity)

    def restoring_energy(self, state: State) -> float:
        """Potential of the restoring, J."""
        return restoring_energy(self.hull.stiffness, self.hull.flotation, state.position[2], rotation_matrix(state.quaternion))

    def hold_energy(self, state: State) -> float:
        """Potential, J, of a thrust that holds for good, zero at the start: a constant force supplies nothing that it cannot take back."""
        if self.law is not None:
            return 0.0
        (x, y, _), start = self.parameters.hold_force, self.parameters.start.position
        return -x * float(state.position[0] - start[0]) - y * float(state.position[1] - start[1])

    def hang_off_pose(self, position: Array, quaternion: Array) -> tuple[Array, Array]:
        """Hang-off point (3,), m in e, and orientation (4,) t to e of the pipe section held there, eq. (5)."""
        point = position + rotation_matrix(quaternion) @ self.hull.hang_off
        return point, multiply(quaternion, self.held_section)

    def hang_off_velocity(self, quaternion: Array, nu: Array) -> Array:
        """Velocity, m/s, and angular velocity, rad/s, of the hang-off point, (6,) in e, for a body velocity nu (6,); eq. (68)."""
        rotation = rotation_matrix(quaternion)
        return np.concatenate([rotation @ (nu[:3] + np.cross(nu[3:], self.hull.hang_off)), rotation @ nu[3:]])

    def moment_about_centre(self, quaternion: Array, force: Array, moment: Array) -> Array:
        """Moment (3,), N m in e, about the centre of gravity of a force and a moment at the hang-off point."""
        total = moment.copy()
        add_cross(total, 1.0, rotation_matrix(quaternion) @ self.hull.hang_off, force)
        return total

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
        x, y, yaw = self.parameters.hold_force
        return [x, y, 0.0] - rotation @ load[:3], [0.0, 0.0, yaw] - rotation @ load[3:]
