"""Equations and data of the hydraulic manipulator, manoeuvre M1.

Source: Laboratorio de Ingenieria Mecanica, Universidade da Coruna, co-simulation benchmarks: 2-d.o.f. hydraulic manipulator;
used by B. Rodriguez et al., Energy-based monitoring and correction to enhance the accuracy and stability of explicit
co-simulation, Multibody Syst. Dyn. 55 (2022). The mass of link 1 counts by a third in the inertia and by half in the weight; the
point masses count in full.
"""

from __future__ import annotations

import math

import numpy as np

LENGTH, HANGING = 1.0, 0.5  # m, links 1 and 2
ROD, AT_Q, AT_R = 200.0, 250.0, 100.0  # kg: link 1, point masses at its end and at that of link 2
GRAVITY = 9.81  # m/s2
ANGLES = (math.pi / 6.0, 1.5 * math.pi)  # rad at the start
PISTON, CYLINDER, FRICTION = 0.0065, 0.442, 1e5  # m2, m, N s/m
VALVE, DISCHARGE, DENSITY = 5e-4, 0.67, 850.0  # m2, 1, kg/m3
PUMP, TANK = 7.6e6, 0.1e6  # Pa
COMPRESSION = (6.53e-10, -1.19e-18)  # a, b of the bulk modulus
OPENINGS = ((2.0, 0.001, -0.01), (6.0, 0.002, 0.03))  # start [s], length [s] and height of the valve's ramps
START_LENGTH = 0.5  # m


def actuator(angle: float) -> tuple[float, float]:
    """Length of the actuator [m] and its derivative by the angle of link 1 [m/rad]."""
    length = LENGTH * math.sqrt(1.0 - 0.5 * math.sqrt(3.0) * math.cos(angle))
    return length, 0.25 * math.sqrt(3.0) * LENGTH**2 * math.sin(angle) / length


def mass_matrix(difference: float) -> np.ndarray:
    """(2, 2) for the angles' difference."""
    mixed = LENGTH * HANGING * AT_R * math.cos(difference)
    return np.array([[LENGTH**2 * (ROD / 3.0 + AT_Q + AT_R), mixed], [mixed, HANGING**2 * AT_R]])


def accelerations(z: np.ndarray, force: float) -> np.ndarray:
    """(angles, rates)' of the arm (4,) under the actuator's push [N]."""
    a, b, p, q = z
    swirl = LENGTH * HANGING * AT_R * math.sin(a - b)
    right = np.array(
        [
            -swirl * q * q - LENGTH * GRAVITY * (ROD / 2.0 + AT_Q + AT_R) * math.cos(a) + actuator(a)[1] * force,
            swirl * p * p - HANGING * GRAVITY * AT_R * math.cos(b),
        ]
    )
    return np.array([p, q, *np.linalg.solve(mass_matrix(a - b), right)])


def energies(z: np.ndarray) -> tuple[float, float]:
    """Kinetic energy and energy of the weight [J]."""
    a, b, rates = z[0], z[1], z[2:]
    kinetic = 0.5 * float(rates @ mass_matrix(a - b) @ rates)
    return kinetic, GRAVITY * (LENGTH * (ROD / 2.0 + AT_Q + AT_R) * math.sin(a) + HANGING * AT_R * math.sin(b))


def spool(time: float, rest: float) -> float:
    """Displacement of the valve's spool, `rest` at equilibrium."""
    return rest + sum(height * min(max((time - start) / length, 0.0), 1.0) for start, length, height in OPENINGS)


def pressure_rates(pressure: np.ndarray, length: float, speed: float, opening: float) -> tuple[np.ndarray, np.ndarray]:
    """Rates (2,) [Pa/s] of both chambers' pressures and their own derivatives (2,) [1/s]; a chamber does not see the other."""
    rates, slopes = np.empty(2), np.empty(2)
    inner, outer = VALVE * opening, VALVE * (1.0 - opening)
    moved = length - START_LENGTH
    for i, (sign, feed, drain) in enumerate(((1.0, inner, outer), (-1.0, outer, inner))):
        p = float(pressure[i])
        a, b = COMPRESSION
        volume = PISTON * (0.5 * CYLINDER - sign * moved)
        modulus = (1.0 + a * p + b * p * p) / (a + 2.0 * b * p)
        stiffening = 1.0 - 2.0 * b * modulus / (a + 2.0 * b * p)
        into, out = math.sqrt(max(2.0 * (PUMP - p) / DENSITY, 0.0)), math.sqrt(max(2.0 * (p - TANK) / DENSITY, 0.0))
        flow = sign * PISTON * speed + DISCHARGE * (feed * into - drain * out)
        fading = -DISCHARGE / DENSITY * ((feed / into if into else 0.0) + (drain / out if out else 0.0))
        rates[i] = modulus / volume * flow
        slopes[i] = stiffening / volume * flow + modulus / volume * fading
    return rates, slopes


def equilibrium() -> tuple[np.ndarray, float]:
    """Pressures (2,) [Pa] that hold the arm at its start, and the spool's displacement that keeps them.

    In equilibrium the same turbulent flow leaves and enters each chamber, so each pressure divides pump and tank by the squares
    of the valve's areas, and their difference fixes the opening.
    """
    push = LENGTH * GRAVITY * (ROD / 2.0 + AT_Q + AT_R) * math.cos(ANGLES[0]) / actuator(ANGLES[0])[1]
    share = push / PISTON / (PUMP - TANK)  # (outer^2 - inner^2) / (outer^2 + inner^2) = (1 - 2 k) / (1 - 2 k + 2 k^2)
    opening = ((share - 1.0) + math.sqrt(1.0 - share**2)) / (2.0 * share)
    inner, outer = opening**2, (1.0 - opening) ** 2
    first, second = (TANK * outer + PUMP * inner) / (inner + outer), (TANK * inner + PUMP * outer) / (inner + outer)
    return np.array([first, second]), opening

