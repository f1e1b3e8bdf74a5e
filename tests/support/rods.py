"""Rods that several validations bend, buckle and shake, and what is asked of them."""

import math

import numpy as np
from pipe_helpers import dense_equilibrium, rotation, rotation_vector_quaternion, static_system, step_system, times
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve


def at_rest(position, attitude):
    """State of rest."""
    zero = np.zeros_like(position)
    return position, attitude, zero, zero


def energy(lines, state):
    """Kinetic and elastic energy [J]."""
    first, total = 0, 0.0
    for line in lines:
        position, attitude, velocity, rate = (a[first : first + len(line.mass)] for a in state)
        first += len(line.mass)
        total += 0.5 * line.mass @ (velocity**2).sum(axis=1) + 0.5 * (line.inertia * rate**2).sum()
        total += sum(static_system(line, position, attitude)[2])
    return total


def cantilever(length, stiffness, tip, force=(0.0, 0.0, 0.0), moment=(0.0, 0.0, 0.0), load=(0.0, 0.0, 0.0), curvature=(0.0, 0.0, 0.0)):
    """(tip position, tip attitude) of a rod clamped along e1 at the origin.

    stiffness (6,): EA, GA, GA, GJ, EI_2, EI_3; force, moment: dead, at the tip; load: dead, per length; curvature: of the stress-free rod;
    tip: trial attitude of the tip. All in e but the curvature.
    """
    stiffness, force, load = np.array(stiffness), np.array(force), np.array(load)

    def slope(s, y):
        q = y[3:7] / np.linalg.norm(y[3:7])
        r = rotation(q)
        n = r.T @ (force + (length - s) * load)
        stretch = np.array([1.0, 0.0, 0.0]) + n / stiffness[:3]
        kappa = curvature + y[7:] / stiffness[3:]
        return np.concatenate([r @ stretch, 0.5 * times(q, np.array([0.0, *kappa])), -np.cross(kappa, y[7:]) - np.cross(stretch, n)])

    def back(theta):
        q = times(rotation_vector_quaternion(theta), np.array(tip))
        start = np.concatenate([np.zeros(3), q, rotation(q).T @ np.array(moment)])
        return solve_ivp(slope, (length, 0.0), start, method="DOP853", rtol=1e-10, atol=1e-11).y[:, -1], q

    theta = fsolve(lambda theta: back(theta)[0][4:7], np.zeros(3), xtol=1e-10, full_output=True)[0]
    root, q = back(theta)
    if np.abs(root[4:7]).max() > 1e-8:
        raise RuntimeError("the clamp is missed")
    return -root[:3], q


def clamped(line, position, attitude, load=0.0, **options):
    """Equilibrium with the first node held."""
    lines = line if isinstance(line, list) else [line]
    n = sum(len(one.length) for one in lines) + 1
    return dense_equilibrium(line, position, attitude, np.arange(6, 6 * n), load, **options)


def at_tip(n, force=(0.0, 0.0, 0.0), moment=(0.0, 0.0, 0.0)):
    """Nodal loads (6 n,) of a force and moment on the last node."""
    return np.concatenate([np.zeros(6 * n - 6), force, moment])


def order(coarse, fine, exact):
    """Observed order from errors at h and h / 2."""
    return math.log2(np.linalg.norm(coarse - exact) / np.linalg.norm(fine - exact))


def extrapolated(coarse, fine):
    """Richardson's value of a second-order sequence at h and h / 2."""
    return fine + (fine - coarse) / 3


UPRIGHT = (math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0)  # t1 along -e3


def critical(load_of, low, high):
    """Load at which the tangent's lowest eigenvalue passes zero."""
    return brentq(load_of, low, high, rtol=1e-7)


def lowest(line, position, attitude, load=0.0):
    free = np.arange(6, 6 * len(position))
    found = dense_equilibrium(line, position, attitude, free, load)
    tangent = static_system(line, *found)[1][np.ix_(free, free)]
    return np.linalg.eigvalsh(0.5 * (tangent + tangent.T))[0]


def matrices(line, position, attitude):
    """(mass, stiffness): the tangent of a step from rest is 2 M / h^2 + K / 2, for any h."""
    n = len(position)
    rest = position, attitude, np.zeros((n, 3)), np.zeros((n, 3))
    one, two = (step_system(line, rest, np.zeros((n, 6)), h)[1] for h in (1e-3, 2e-3))
    mass = (one - two) / (2 * (1e6 - 0.25e6))
    return mass, 2 * (one - 2e6 * mass)
