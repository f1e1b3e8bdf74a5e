"""Independent static solutions of the rod by collocation (scipy's `solve_bvp`): nothing of pipe_fmu is used.

Unknowns over the reference length: position r, attitude q (unit quaternion, section to e), section force n (e) and section moment m
(section components). The plain law (extension along t1, Timoshenko shear) and the loads are written here a second time:

    r' = R (t1 + strain),  q' = q * kappa / 2,  n' = -w e3 - drag + bed,  m' = -kappa x m - (t1 + strain) x R^T n

Units: length of the line, its weight (force), EI over its length (moment), so that the tolerance is relative.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.integrate import solve_bvp
from scipy.optimize import brentq


@dataclass(frozen=True)
class Tube:
    """Steel tube, empty: only the numbers of the ordinary differential equation."""

    diameter: float
    wall: float
    modulus: float = 207e9
    shear_factor: float | None = None  # None: Cowper's
    drag_normal: float = 1.2
    drag_tangential: float = 0.025
    water: float = 1025.0
    gravity: float = 9.81

    @property
    def stiffness(self):
        """EA, GA, GJ, EI."""
        b, a = 0.5 * self.diameter, 0.5 * self.diameter - self.wall
        area, second = np.pi * (b * b - a * a), 0.25 * np.pi * (b**4 - a**4)
        nu, m2 = 0.3, (a / b) ** 2
        k = self.shear_factor
        if k is None:
            k = 6 * (1 + nu) * (1 + m2) ** 2 / ((7 + 6 * nu) * (1 + m2) ** 2 + (20 + 12 * nu) * m2)
        shear = self.modulus / (2 * (1 + nu))
        return self.modulus * area, k * shear * area, 2 * shear * second, self.modulus * second

    @property
    def weight(self):
        """Submerged weight per length [N/m]."""
        b, a = 0.5 * self.diameter, 0.5 * self.diameter - self.wall
        return self.gravity * np.pi * (7850.0 * (b * b - a * a) - self.water * b * b)


TUBES = {"P12": Tube(0.32385, 0.0206), "P16": Tube(0.4064, 0.0222), "P30": Tube(0.761, 0.0355, 210e9)}
PEER = Tube(0.4064, 0.025, shear_factor=0.5, drag_normal=1.0, drag_tangential=0.01 * np.pi)


@dataclass(frozen=True)
class Solution:
    """Sampled on `s`: position (3, n), quaternion (4, n), force (3, n) in e, moment (3, n) in the section; `at` interpolates."""

    length: float
    weight: float
    bending: float
    interpolant: object

    def at(self, s):
        """(position [m], quaternion, force [N] in e, moment [N m] in the section, tension [N], shear (2, n) [N]) at arc lengths s."""
        y = self.interpolant(np.atleast_1d(np.asarray(s, dtype=float)) / self.length)
        q = y[3:7] / np.linalg.norm(y[3:7], axis=0)
        force = y[7:10] * self.weight * self.length
        material = turn_back(q, force)
        return y[0:3] * self.length, q, force, y[10:13] * self.bending / self.length, material[0], material[1:]


def columns(q):
    """Rotation matrix entries (3, 3, n) of quaternions (4, n)."""
    w, x, y, z = q
    return np.array(
        [
            [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
        ]
    )


def turn_back(q, v):
    """R^T v for columns."""
    return np.einsum("jin,jn->in", columns(q), v)


def product(p, q):
    """Quaternion product, columns."""
    return np.array(
        [
            p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
            p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
            p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
            p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
        ]
    )


def bed_reaction(z, diameter, weight):
    """Upward force per length of the regularised bed law (published pipelay law shifted by d/8)."""
    p = z + diameter / 8
    quadratic = 10 * weight * p**2 / (diameter / 8 - diameter / 40) / diameter
    linear = weight * (p - diameter / 40) / (diameter / 8 - diameter / 40)
    return np.where(p < 0, 0.0, np.where(p < diameter / 20, quadratic, linear))


def catenary(length, distance, height, s, bed, least):
    """Starting shape (x, up, slope, horizontal force over weight per length); the latter at least `least` where there is no bed."""
    ratio = np.sqrt(length**2 - height**2) / distance
    q = brentq(lambda q: np.sinh(q) / q - ratio, 1e-6, 100.0)
    c = distance / (2 * q)
    low = distance / 2 - c * np.arctanh(height / length)
    if bed and low > 0:
        c = brentq(lambda c: np.sqrt(height**2 + 2 * height * c) - c * np.arccosh(1 + height / c) - length + distance, 1e-3, 1e7)
        hung = np.maximum(s - length + np.sqrt(height**2 + 2 * height * c), 0.0)
        x = distance - c * np.arccosh(1 + height / c) + c * np.arcsinh(hung / c)
        x = np.where(hung > 0, x, s)
        return x, np.sqrt(hung**2 + c * c) - c, np.arctan2(hung, c), c
    start, c = c * np.sinh(-low / c), max(c, least)
    return (
        low + c * np.arcsinh((s + start) / c),
        np.hypot(s + start, c) - np.hypot(start, c),
        np.arctan2(s + start, c),
        c,
    )


@cache
def solve(
    tube,
    length,
    distance,
    height,
    top_angle=None,
    foot="clamped",
    current=0.0,
    depth=None,
    bed=False,
    tolerance=1e-8,
    direction=(0.0, 1.0, 0.0),
):
    """Static line from a foot at the origin (clamped along x, or pinned) to (distance, 0, -height).

    top_angle: pitch of the clamped top section above the horizontal [rad], None for a pinned top. current: speed at the surface [m/s]
    along `direction`, linear to zero at the bed `depth` below.
    """
    axial, shear, torsion, bending = tube.stiffness
    w = tube.weight
    depth = depth or height
    force, moment = w * length, bending / length
    drag = 0.5 * tube.water * tube.diameter
    heading = np.array(direction)[:, None]

    def rates(s, y, _=None):
        q = y[3:7]
        n_t = turn_back(q / np.linalg.norm(q, axis=0), y[7:10] * force)
        m_t = y[10:13] * moment
        kappa = m_t * np.array([1 / torsion, 1 / bending, 1 / bending])[:, None]
        stretch = np.array([1 + n_t[0] / axial, n_t[1] / shear, n_t[2] / shear])
        rotation = columns(q / np.linalg.norm(q, axis=0))
        out = np.empty_like(y)
        out[0:3] = np.einsum("ijn,jn->in", rotation, stretch)
        out[3:7] = 0.5 * length * product(q, np.vstack([0 * s, kappa]))
        down = np.full_like(s, w)
        if bed:
            down = down - bed_reaction(y[2] * length, tube.diameter, w)
        load = np.vstack([0 * s, 0 * s, down])
        if current:
            water = current * np.clip(-y[2] * length / depth, 0, 1) * heading
            t1 = rotation[:, 0, :]
            along = np.sum(t1 * water, axis=0)
            across = water - along * t1
            load = load + drag * (
                tube.drag_normal * np.linalg.norm(across, axis=0) * across + tube.drag_tangential * np.abs(along) * along * t1
            )
        out[7:10] = -load * length / force
        out[10:13] = -length / moment * (np.cross(kappa, m_t, axis=0) + np.cross(stretch, n_t, axis=0))
        return out

    held = None if top_angle is None else np.array([np.cos(top_angle / 2), 0, np.sin(top_angle / 2), 0])

    def ends(a, b):
        low = [a[3] - 1, a[4], a[5], a[6]] if foot == "clamped" else [a[11], a[12], a[3:7] @ a[3:7] - 1, a[4]]
        if held is None:
            high = list(b[10:13])
        else:
            inverse = held * np.array([1, -1, -1, -1])
            high = list(product(inverse[:, None], b[3:7, None])[1:, 0])
        return np.array([*a[0:3], *low, b[0] - distance / length, b[1], b[2] + height / length, *high])

    near = np.linspace(0, 80.0, 81)
    s = np.unique(np.concatenate([np.linspace(0, length, 401), near, length - near])) / length
    x, up, slope, c = catenary(length, distance, height, s * length, bed, 0.5 * (bending / w) ** (1.0 / 3.0))
    y = np.zeros((13, len(s)))
    y[0], y[2] = x / length, -up / length
    y[3], y[5] = np.cos(slope / 2), np.sin(slope / 2)
    y[7], y[9] = c / length, -c * np.tan(slope) / length
    y[11] = np.gradient(slope, s)
    if current:  # the planar line first
        plane = solve(tube, length, distance, height, top_angle, foot, 0.0, depth, bed, 1e-4)
        y = plane.interpolant(s)
    found = solve_bvp(rates, ends, s, y, tol=tolerance, max_nodes=100000)
    if not found.success:
        raise RuntimeError(found.message)
    return Solution(length, w, bending, found.sol)
