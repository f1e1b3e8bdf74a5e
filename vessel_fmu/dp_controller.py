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

from .attitude import Array
from .parameters import VesselParameters, mass_matrix, set_point

GRID_TOLERANCE = 1e-6  # of a period: a step that begins this much early still takes the sample
HORIZONTAL = [0, 1, 5]


class Law(NamedTuple):
    """Constants of the controller; arrays (3,) are surge, sway, yaw."""

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

    sample: int  # number of the last sample, -1 before the first
    time: float  # s, of the last sample
    reference: Array  # (3, 3): eta_d and its two derivatives, each x, y, yaw
    integral: Array  # (3,) x, y in e, N; yaw, N m
    thrust: Array  # (3,) held thrust, the same
    pull: Array  # (3,) low-passed pull of the pipe, the same


def control_law(parameters: VesselParameters) -> Law | None:
    """Constants of the controller, None where there is none."""
    c = parameters.controller
    if c is None:
        return None
    mass = np.diag(mass_matrix(parameters))[HORIZONTAL]
    w = c.natural_frequency
    return Law(
        start=c.start,
        period=c.period,
        mass=mass,
        stiffness=mass * w**2,
        damping=2.0 * c.damping_ratio * w * mass,
        integral=c.integral_ratio * mass * w**3,
        limit=np.array([c.surge_limit, c.sway_limit, c.yaw_limit]),
        set_point=np.array(set_point(parameters)),
        filter_time=c.filter_time,
        pull_time=c.feed_forward_time,
        tracking_time=1.0 / w,
    )


def initial_control(hold: Array, pose: Array) -> ControlState:
    """State that applies the constant thrust `hold` (3,); pose (3,) is x, y, yaw."""
    reference = np.vstack([pose, np.zeros((2, 3))])
    return ControlState(-1, 0.0, reference, np.zeros(3), hold, -hold)


def wrap(angle: float) -> float:
    """The angle, rad, in [-pi, pi)."""
    return angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5)


def filtered(reference: Array, set_point: Array, time_constant: float, dt: float) -> Array:
    """Reference (3, 3) after dt: exact solution of (1 + T d/dt)^3 eta_d = set_point."""
    rate = 1.0 / time_constant
    decay = math.exp(-rate * dt)
    eta, eta_dot, eta_ddot = reference
    offset = eta - set_point
    c1 = eta_dot + rate * offset
    c2 = 0.5 * (eta_ddot + 2.0 * rate * eta_dot + rate * rate * offset)
    x = decay * (offset + dt * (c1 + dt * c2))
    x_dot = decay * (c1 + 2.0 * dt * c2) - rate * x
    x_ddot = decay * 2.0 * c2 - 2.0 * rate * x_dot - rate * rate * x
    return np.array([set_point + x, x_dot, x_ddot])


def heading(yaw: float) -> Array:
    """Rotation (3, 3) of (surge, sway, yaw moment) along the heading to (x, y, yaw moment) in e."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def pid(law: Law, reference: Array, integral: Array, pull: Array, pose: Array, velocity: Array, dt: float) -> tuple[Array, Array]:
    """Integral (3,) and thrust (3,), both in e, at a sample dt after the last one; pose (x, y, yaw) and its rate."""
    along = heading(pose[2])
    offset = reference[0] - pose
    offset[2] = wrap(offset[2])
    error, rate, acceleration, total, pull = np.array([offset, reference[1] - velocity, reference[2], integral, pull]) @ along
    total += dt * law.integral * error
    wanted = law.stiffness * error + law.damping * rate + law.mass * acceleration + total - pull
    thrust = np.maximum(np.minimum(wanted, law.limit), -law.limit)
    total += (1.0 - math.exp(-dt / law.tracking_time)) * (thrust - wanted)  # back-calculation against windup
    return along @ total, along @ thrust


def due_sample(law: Law, state: ControlState, time: float) -> int | None:
    """Number of the sample due at `time`, s; None if there is none."""
    sample = math.floor((time - law.start) / law.period + GRID_TOLERANCE)
    return sample if sample > state.sample and sample >= 0 else None


def sampled(law: Law, state: ControlState, sample: int, time: float, pose: Array, velocity: Array) -> ControlState:
    """State after sample number `sample` taken at `time`, s; pose (3,) is x, y, yaw and velocity (3,) its rate, in e."""
    if state.sample < 0:
        dt, integral = 0.0, state.thrust + state.pull
        reference = np.array([pose, velocity, np.zeros(3)])
    else:
        dt, integral = time - state.time, state.integral
        set_point = law.set_point.copy()
        set_point[2] = state.reference[0, 2] + wrap(law.set_point[2] - state.reference[0, 2])
        reference = filtered(state.reference, set_point, law.filter_time, dt)
    integral, thrust = pid(law, reference, integral, state.pull, pose, velocity, dt)
    return ControlState(sample, time, reference, integral, thrust, state.pull)


def with_pull(law: Law, state: ControlState, pull: Array, h: float) -> ControlState:
    """State after an accepted step h, s, with the pull (3,) of the pipe held over it: first-order low-pass, exact for a held value."""
    share = -math.expm1(-h / law.pull_time)
    return state._replace(pull=state.pull + share * (pull - state.pull))
