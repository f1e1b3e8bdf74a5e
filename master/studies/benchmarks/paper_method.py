"""Contestant: the paper's own method. Euler angles (zyx) as nodal unknowns, equal linear elements with one Gauss point, and a stiff
variable-step BDF (scipy's, which is the formula of ode15s) on eqs. (25)-(27), (93)-(100) with the signs and slips corrected.

Internal forces are the exact derivative of the discrete energy; masses are lumped, so that the mass matrix is a block a node. The angular
velocity w (material) is the state, Theta' = Pi_t^-1 w, eq. (96), which is singular where a section stands upright: the method cannot
start from a vertical pipe at all.
"""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.sparse import csr_matrix, kron
from scipy.spatial.transform import Rotation

from master.errors import RunError
from master.studies.benchmarks.histories import Histories, LineCase, Setting, instants
from pipe_fmu import Pipe, PipeParameters
from pipe_fmu.compiled import kernel

_STEADY = 1e-9  # of the line's weight: residual of the static shape
_DIFFERENCE = 1e-3  # s for the velocity and acceleration of the prescribed top


@kernel
def rotation_and_rates(angles):
    """R (3, 3), t to e, of (roll, pitch, yaw), and Pi_t (3, 3): w_t = Pi_t Theta'."""
    sx, cx, sy, cy, sz, cz = (
        math.sin(angles[0]), math.cos(angles[0]), math.sin(angles[1]), math.cos(angles[1]), math.sin(angles[2]), math.cos(angles[2])
    )  # fmt: skip
    rotation = np.array(
        [
            [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
            [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
            [-sy, cy * sx, cy * cx],
        ]
    )
    return rotation, np.array([[1.0, 0.0, -sy], [0.0, cx, sx * cy], [0.0, -sx, cx * cy]])


@kernel
def forces(position, angles, velocity, h, stiffness, weight, across, along, current):
    """Nodal forces (n, 3), e, and generalised moments (n, 3) on the angles, of eq. (93); and the bending moments (n - 1,) of the elements.

    stiffness: EA, GA, GJ, EI_2, EI_3; weight, across, along: submerged weight and drag factors per length; current: depth, speed along y at
    the surface, falling linearly to zero.
    """
    n = len(position)
    force, moment, bending = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(n - 1)
    for e in range(n - 1):
        rotation, rates = rotation_and_rates(0.5 * (angles[e] + angles[e + 1]))
        slope, turn = (position[e + 1] - position[e]) / h, (angles[e + 1] - angles[e]) / h
        along_t = rotation.T @ slope
        kappa = rates @ turn
        n_t = np.array([stiffness[0] * (along_t[0] - 1.0), stiffness[1] * along_t[1], stiffness[1] * along_t[2]])
        m_t = np.array([stiffness[2] * kappa[0], stiffness[3] * kappa[1], stiffness[4] * kappa[2]])
        bending[e] = math.hypot(m_t[1], m_t[2])
        n_e, generalised = rotation @ n_t, rates.T @ m_t
        swept = rates.T @ np.array(  # n_t . d(R^T phi')/dTheta = Pi_t^T (phi'_t x n_t), d(R^T phi') being -(Pi_t dTheta) x phi'_t
            [
                along_t[1] * n_t[2] - along_t[2] * n_t[1],
                along_t[2] * n_t[0] - along_t[0] * n_t[2],
                along_t[0] * n_t[1] - along_t[1] * n_t[0],
            ]
        )
        mean = 0.5 * (angles[e] + angles[e + 1])
        sx, cx, sy, cy = math.sin(mean[0]), math.cos(mean[0]), math.sin(mean[1]), math.cos(mean[1])
        by_roll = m_t[1] * (-sx * turn[1] + cx * cy * turn[2]) + m_t[2] * (-cx * turn[1] - sx * cy * turn[2])
        by_pitch = -m_t[0] * cy * turn[2] - m_t[1] * sx * sy * turn[2] - m_t[2] * cx * sy * turn[2]
        swept[0] -= by_roll
        swept[1] -= by_pitch
        for i in range(3):
            force[e, i] += n_e[i]
            force[e + 1, i] -= n_e[i]
            moment[e, i] += 0.5 * h * swept[i] + generalised[i]
            moment[e + 1, i] += 0.5 * h * swept[i] - generalised[i]
    for k in range(n):
        share = h if 0 < k < n - 1 else 0.5 * h
        tangent = rotation_and_rates(angles[k])[0][:, 0].copy()
        relative = -velocity[k]
        relative[1] += current[1] * min(max(-position[k, 2] / current[0], 0.0), 1.0)
        forward = relative @ tangent
        sideways = relative - forward * tangent
        force[k] += share * (across * math.sqrt(sideways @ sideways) * sideways + along * abs(forward) * forward * tangent)
        force[k, 2] += share * weight
    return force, moment, bending


@kernel
def rates_of(y, n, h, mass, inertia, stiffness, weight, across, along, current, speed):
    """dy/dt of y = position, angles, velocity, w, each (n, 3), flat by node; the foot is held and the top moves with `speed` (3,)."""
    state = y.reshape(n, 12)
    position, angles, velocity, spin = state[:, :3].copy(), state[:, 3:6].copy(), state[:, 6:9].copy(), state[:, 9:].copy()
    velocity[-1] = speed
    force, moment, _ = forces(position, angles, velocity, h, stiffness, weight, across, along, current)
    out = np.zeros((n, 12))
    for k in range(1, n):
        share = h if k < n - 1 else 0.5 * h
        _, rates = rotation_and_rates(angles[k])
        inverse = np.linalg.inv(rates)
        w, torque = spin[k], inverse.T @ moment[k]
        l = share * inertia * w  # noqa: E741  (angular momentum)
        gyro = np.array([w[1] * l[2] - w[2] * l[1], w[2] * l[0] - w[0] * l[2], w[0] * l[1] - w[1] * l[0]])
        out[k, :3] = velocity[k]
        out[k, 3:6] = inverse @ w
        out[k, 9:] = (torque - gyro) / (share * inertia)
        if k < n - 1:
            out[k, 6:9] = force[k] / (share * mass)
    return out.ravel()


class Model:
    """The discretised pipe of one section, its foot clamped along x and its top pinned. Raises RunError where it finds no static shape."""

    def __init__(self, parameters: PipeParameters, elements: int) -> None:
        section, environment = parameters.section, parameters.environment
        assert environment.current is not None
        self.n, self.h = elements + 1, parameters.length / elements
        self.mass, self.inertia = section.mass_per_length, np.array(section.inertia)
        weight = (self.mass - environment.water_density * section.outer_area) * environment.gravity
        factor = 0.5 * environment.water_density * section.outer_diameter
        current = np.array([environment.depth, environment.current.velocity[1]])
        self.loads: tuple[Any, ...] = (
            np.array(section.stiffness), weight, factor * section.drag_normal, factor * section.drag_tangential, current
        )  # fmt: skip
        found, _ = Pipe(parameters).start(0.0)
        turned = Rotation.from_quat(np.roll(found.quaternion, -1, axis=1)).as_euler("ZYX")[:, ::-1]
        self.rest = self._settle(np.hstack([found.position, turned]), weight * parameters.length)

    def _settle(self, start: np.ndarray, scale: float) -> np.ndarray:
        """The static shape (n, 6), by Newton's method from `start` with a Jacobian by differences."""
        free = np.arange(6, 6 * self.n)
        free = free[(free < 6 * self.n - 6) | (free >= 6 * self.n - 3)]
        still = np.zeros((self.n, 3))

        def residual(shape: np.ndarray) -> np.ndarray:
            force, moment, _ = forces(shape[:, :3].copy(), shape[:, 3:].copy(), still, self.h, *self.loads)
            return np.hstack([force, moment]).ravel()[free]

        shape, flat = start.copy(), start.size
        for _ in range(30):
            out = residual(shape)
            if np.abs(out).max() < _STEADY * scale:
                return shape
            moves = 1e-7 * np.eye(flat)[free].reshape(-1, self.n, 6)
            slope = np.array([(residual(shape + d) - residual(shape - d)) / 2e-7 for d in moves]).T
            step = np.zeros(flat)
            step[free] = np.linalg.solve(slope, -out)
            shape = shape + step.reshape(self.n, 6) * min(1.0, 0.25 / np.abs(step).max())
        raise RunError(f"the paper's method: no static shape with {self.n - 1} elements, residual {np.abs(residual(shape)).max():.1e} N")

    def rates(self, y: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """dy/dt."""
        stiffness, weight, across, along, current = self.loads
        return np.asarray(rates_of(y, self.n, self.h, self.mass, self.inertia, stiffness, weight, across, along, current, speed))


def run(parameters: PipeParameters, case: LineCase, setting: Setting) -> tuple[float, Histories]:
    """CPU time [s] of the integration and the histories; `step_s` is the tolerance, relative and absolute.

    Raises RunError where it breaks down.
    """
    model, motion, eps = Model(parameters, setting.elements), case.motion, _DIFFERENCE
    start = np.hstack([model.rest, np.zeros((model.n, 6))]).ravel()

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        return model.rates(y, (motion(t + eps)[0] - motion(t - eps)[0]) / (2.0 * eps))

    neighbours = np.eye(model.n) + np.eye(model.n, k=1) + np.eye(model.n, k=-1)
    pattern = csr_matrix(kron(neighbours, np.ones((12, 12))))
    times = instants(case.duration)
    rates(0.0, start)
    begin = time.process_time()
    found = solve_ivp(rates, (0.0, times[-1]), start, "BDF", times, rtol=setting.step_s, atol=setting.step_s, jac_sparsity=pattern)
    spent = time.process_time() - begin
    if not found.success:
        raise RunError(f"the paper's method with {setting.elements} elements stopped at {found.t[-1]:g} s: {found.message}")
    return spent, _histories(model, case, times, found.y.T.reshape(len(times), model.n, 12))


def _histories(model: Model, case: LineCase, times: np.ndarray, states: np.ndarray) -> Histories:
    """The top force is what its half element and the acceleration of its mass leave."""
    top, bending, eps = [], [], _DIFFERENCE
    for t, state in zip(times, states, strict=True):
        before, now, after = (case.motion(t + k * eps)[0] for k in (-1, 0, 1))
        velocity = state[:, 6:9].copy()
        velocity[-1] = (after - before) / (2.0 * eps)
        force, _, moments = forces(state[:, :3].copy(), state[:, 3:6].copy(), velocity, model.h, *model.loads)
        top.append(0.5 * model.h * model.mass * (after - 2.0 * now + before) / eps**2 - force[-1])
        bending.append(moments.max())
    quarters = [k * (model.n - 1) // 4 for k in (1, 2, 3)]
    return Histories(states[:, quarters, :3], np.array(top), np.array(bending))
