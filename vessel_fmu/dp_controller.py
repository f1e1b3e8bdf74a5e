"""Dynamic positioning: PID in surge, sway and yaw with reference filter, feed-forward of the pipe's pull, saturation and anti-windup.

Gains by pole placement (MSS `PIDnonlinearMIMO`): K_p = M w_n^2, K_d = 2 zeta w_n M, K_i = ratio w_n K_p, M the diagonal
of M_RB + M_A. The reference (1 + T s)^3 eta_d = eta_set is propagated exactly, so that its poles do not depend on the
sampling. The pull of the pipe is low-passed over accepted steps and fed forward as it was at the sample: held over a
step, it leaves the vessel's mobility in the coupling untouched.

The thrust is a horizontal force and a yaw moment, held in e from sample to sample and limited along and across the
heading. At the start the reference takes the vessel's position and velocity and the integral the thrust that held it,
so that the thrust goes on without a jump. Samples are due at start + k period and taken at the first step that begins
then or later, with the time that really passed; steps need not divide the period.
"""

import math
from typing import NamedTuple

import numpy as np

from .attitude import Array, angles_from_quaternion, apply, fill, heading, product, rotation_matrix
from .compiled import inlined, kernel
from .hydrodynamics import ADDED_MASS, INERTIA, MASS
from .parameters import place
from .rigid_body import mass_matrix

GRID_TOLERANCE = 1e-6  # of a period: a step that begins this much early still takes the sample
HORIZONTAL = np.array([0, 1, 5])
SET_POINT = np.array([place(f"controller.{name}") for name in ("x", "y", "yaw")])
AT_START = np.array([place(name) for name in ("start.position[1]", "start.position[2]", "start.attitude[3]")])
LIMITS = np.array([place(f"controller.{name}_limit") for name in ("surge", "sway", "yaw")])
START, PERIOD, FREQUENCY, DAMPING_RATIO, INTEGRAL_RATIO, FILTER_TIME, PULL_TIME = (
    place(f"controller.{name}")
    for name in ("start", "period", "natural_frequency", "damping_ratio", "integral_ratio", "filter_time", "feed_forward_time")
)
HOLD = place("hold_force")
MEMORY = 20  # numbers of a ControlState


class Law(NamedTuple):
    """Constants of the controller; arrays (3,) are surge, sway, yaw; NaN where there is none."""

    start: float  # s
    period: float  # s
    mass: Array  # kg, kg, kg m^2
    stiffness: Array  # K_p
    damping: Array  # K_d
    integral: Array  # K_i
    limit: Array  # N, N, N m
    set_point: Array  # x, y in e, m; yaw, rad
    filter_time: float  # s
    pull_time: float  # s
    tracking_time: float  # s, of the anti-windup


class ControlState(NamedTuple):
    """Memory of the controller; values are never mutated."""

    sample: float  # number of the last sample, -1 before the first
    time: float  # s, of the last sample
    reference: Array  # (3, 3): eta_d and its two derivatives, each x, y, yaw
    integral: Array  # (3,) x, y in e, N; yaw, N m
    thrust: Array  # (3,) held thrust, the same
    pull: Array  # (3,) low-passed pull of the pipe, the same


@inlined
def set_point(values: Array) -> Array:
    """Set-point (3,): x, y, m in e, and heading, rad: what the controller names, else where the vessel starts."""
    named = np.empty(3)
    for i in range(3):
        named[i] = values[SET_POINT[i]]
        if math.isnan(named[i]):
            named[i] = values[AT_START[i]]
    return named


@kernel
def control_law(values: Array) -> Law:
    """The controller of the parameters' `values`."""
    matrix, w = mass_matrix(values[MASS], values[INERTIA], values[ADDED_MASS]), values[FREQUENCY]
    table = np.empty((5, 3))
    mass, stiffness, damping, integral, limit = table[0], table[1], table[2], table[3], table[4]
    for i in range(3):
        mass[i] = matrix[HORIZONTAL[i], HORIZONTAL[i]]
        stiffness[i] = mass[i] * w**2
        damping[i] = 2.0 * values[DAMPING_RATIO] * w * mass[i]
        integral[i] = values[INTEGRAL_RATIO] * mass[i] * w**3
        limit[i] = values[LIMITS[i]]
    return Law(
        values[START],
        values[PERIOD],
        mass,
        stiffness,
        damping,
        integral,
        limit,
        set_point(values),
        values[FILTER_TIME],
        values[PULL_TIME],
        1.0 / w,
    )


@inlined
def initial_control(hold: Array, pose: Array) -> ControlState:
    """State that applies the constant thrust `hold` (3,); pose (3,) is x, y, yaw."""
    reference = np.zeros((3, 3))
    fill(reference[0], pose)
    return ControlState(-1.0, 0.0, reference, np.zeros(3), hold, -hold)


@inlined
def remembered(memory: Array) -> ControlState:
    """The state that `memory` (20,) holds."""
    reference = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            reference[i, j] = memory[2 + 3 * i + j]
    return ControlState(memory[0], memory[1], reference, memory[11:14], memory[14:17], memory[17:20])


@inlined
def remember(state: ControlState, memory: Array) -> None:
    """Fill `memory` (20,) with the state."""
    memory[0], memory[1] = state.sample, state.time
    for i in range(3):
        for j in range(3):
            memory[2 + 3 * i + j] = state.reference[i, j]
        memory[11 + i], memory[14 + i], memory[17 + i] = state.integral[i], state.thrust[i], state.pull[i]


@kernel
def wrap(angle: float) -> float:
    """The angle, rad, in [-pi, pi)."""
    return angle - 2.0 * math.pi * np.floor(angle / (2.0 * math.pi) + 0.5)


@inlined
def filtered(reference: Array, set_point: Array, time_constant: float, dt: float) -> Array:
    """Reference (3, 3) after dt: exact solution of (1 + T d/dt)^3 eta_d = set_point."""
    rate, after = 1.0 / time_constant, np.empty((3, 3))
    decay = math.exp(-rate * dt)
    for i in range(3):
        eta, eta_dot, eta_ddot = reference[0, i], reference[1, i], reference[2, i]
        offset = eta - set_point[i]
        c1 = eta_dot + rate * offset
        c2 = 0.5 * (eta_ddot + 2.0 * rate * eta_dot + rate * rate * offset)
        x = decay * (offset + dt * (c1 + dt * c2))
        x_dot = decay * (c1 + 2.0 * dt * c2) - rate * x
        after[0, i], after[1, i] = set_point[i] + x, x_dot
        after[2, i] = decay * 2.0 * c2 - 2.0 * rate * x_dot - rate * rate * x
    return after


@inlined
def pid(law: Law, reference: Array, integral: Array, pull: Array, pose: Array, velocity: Array, dt: float) -> tuple[Array, Array]:
    """Integral (3,) and thrust (3,), both in e, at a sample dt after the last one; pose (x, y, yaw) and its rate."""
    along, rows = heading(pose[2]), np.empty((5, 3))
    for i in range(3):
        rows[0, i], rows[1, i], rows[2, i] = reference[0, i] - pose[i], reference[1, i] - velocity[i], reference[2, i]
        rows[3, i], rows[4, i] = integral[i], pull[i]
    rows[0, 2] = wrap(rows[0, 2])
    rows = product(rows, along)  # along the heading: error, rate, acceleration, integral, pull
    total, thrust = np.empty(3), np.empty(3)
    tracked = 1.0 - math.exp(-dt / law.tracking_time)
    for i in range(3):
        total[i] = rows[3, i] + dt * law.integral[i] * rows[0, i]
        wanted = law.stiffness[i] * rows[0, i] + law.damping[i] * rows[1, i] + law.mass[i] * rows[2, i] + total[i] - rows[4, i]
        thrust[i] = max(min(wanted, law.limit[i]), -law.limit[i])
        total[i] += tracked * (thrust[i] - wanted)  # back-calculation against windup
    return apply(along, total), apply(along, thrust)


@inlined
def due_sample(law: Law, state: ControlState, time: float) -> float:
    """Number of the sample due at `time`, s; -1 if there is none."""
    sample = np.floor((time - law.start) / law.period + GRID_TOLERANCE)
    return sample if sample > state.sample and sample >= 0.0 else -1.0


@inlined
def sampled(law: Law, state: ControlState, sample: float, time: float, pose: Array, velocity: Array) -> ControlState:
    """State after sample number `sample` taken at `time`, s; pose (3,) is x, y, yaw and velocity (3,) its rate, in e."""
    dt, integral, reference = 0.0, state.integral, np.zeros((3, 3))
    if state.sample < 0.0:
        integral = state.thrust + state.pull
        fill(reference[0], pose)
        fill(reference[1], velocity)
    else:
        dt, set_point = time - state.time, law.set_point.copy()
        set_point[2] = state.reference[0, 2] + wrap(law.set_point[2] - state.reference[0, 2])
        reference = filtered(state.reference, set_point, law.filter_time, dt)
    integral, thrust = pid(law, reference, integral, state.pull, pose, velocity, dt)
    return ControlState(sample, time, reference, integral, thrust, state.pull)


@inlined
def controlled(law: Law, state: ControlState, time: float, position: Array, quaternion: Array, nu: Array) -> ControlState:
    """State with the thrust that acts from `time`, s, on: position (3,) in e, quaternion (4,) b to e, body velocity nu (6,)."""
    sample = due_sample(law, state, time)
    if sample < 0.0:
        return state
    rotation, pose = rotation_matrix(quaternion), position.copy()
    pose[2] = angles_from_quaternion(quaternion)[2]
    velocity = apply(rotation, nu[:3])
    velocity[2] = apply(rotation, nu[3:])[2]
    return sampled(law, state, sample, time, pose, velocity)


@inlined
def with_pull(law: Law, state: ControlState, pull: Array, h: float) -> ControlState:
    """State after an accepted step h, s, with the pull (3,) of the pipe held over it: first-order low-pass, exact for a held value."""
    if math.isnan(law.period):
        return state
    share, low = -math.expm1(-h / law.pull_time), np.empty(3)
    for i in range(3):
        low[i] = state.pull[i] + share * (pull[i] - state.pull[i])
    return ControlState(state.sample, state.time, state.reference, state.integral, state.thrust, low)


@kernel
def holds_for_good(values: Array) -> bool:
    """Whether no controller ever takes over from a hold thrust that pushes."""
    return math.isnan(values[PERIOD]) and (values[HOLD][0] != 0.0 or values[HOLD][1] != 0.0)


@inlined
def hold_energy(values: Array, position: Array) -> float:
    """Potential, J, of a thrust that holds for good, zero at the start: a constant force supplies nothing that it cannot take back."""
    if not holds_for_good(values):
        return 0.0
    return -values[HOLD][0] * (position[0] - values[AT_START[0]]) - values[HOLD][1] * (position[1] - values[AT_START[1]])
