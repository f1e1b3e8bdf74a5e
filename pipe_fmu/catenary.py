"""Inextensible catenary between two points, free or partly lying on the bed: the shape from which the statics start."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LEAST_HEIGHT = 1e-6  # of the length: a top on the bed


def parameter(length: float, distance: float, height: float, on_bed: bool) -> tuple[float, float]:
    """Horizontal force over weight per length, c [m], and length lying on the bed [m] of an inextensible line.

    The line has `length`, its top lies `distance` ahead of and `height` above its foot. With `on_bed` it does not hang below the foot.
    """
    height = max(height, LEAST_HEIGHT * length)
    chord = math.sqrt(max(length**2 - height**2, 0.0))
    distance = max(distance, 1e-6 * length)
    ratio = chord / distance
    q = math.sqrt(6.0 * (ratio - 1.0)) if ratio < 1.0 + 1e-12 else _root(lambda q: _sinhc(q) - ratio, 1e-7, 700.0)
    c = 0.5 * distance / max(q, 1e-7)
    lowest = 0.5 * distance - c * math.atanh(height / length)  # where the free line has its lowest point
    if not on_bed or lowest <= 1e-9 * length:
        return c, 0.0
    slack = length - distance

    def excess(c: float) -> float:
        return math.sqrt(height**2 + 2.0 * height * c) - c * math.acosh(1.0 + height / c) - slack

    low = 1e-6 * height
    if excess(low) < 0.0:  # more than hangs straight down: the rest lies slack
        return low, length - height
    c = _root(lambda c: -excess(c), low, 1e6 * height)
    return c, length - math.sqrt(height**2 + 2.0 * height * c)


def _sinhc(q: float) -> float:
    return math.sinh(q) / q


def _root(increasing: Callable[[float], float], low: float, high: float) -> float:
    """Root of a function between `low` and `high`, to the last bit, by bisection.

    The functions here cost a microsecond; scipy's solvers would cost every exported unit half a second at its start, and 140 MB.
    """
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (low, middle) if increasing(middle) > 0.0 else (middle, high)
    return middle


def shape(s: Array, length: float, top: tuple[float, float, float], on_bed: bool) -> tuple[Array, Array]:
    """Positions (n, 3) [m] and attitudes (n, 4) of the sections at arc lengths `s` (n,) of a line from the origin to `top`, in e."""
    distance, height, heading = math.hypot(top[0], top[1]), -top[2], math.atan2(top[1], top[0])
    height = max(height, LEAST_HEIGHT * length)
    c, lying = parameter(length, distance, height, on_bed)
    if lying > 0.0:
        hung = np.maximum(s - lying, 0.0)
        forward = np.minimum(s, lying) * (distance - c * math.acosh(1.0 + height / c)) / lying + c * np.arcsinh(hung / c)
        up = np.sqrt(hung**2 + c**2) - c
        slope = np.arctan2(hung, c)
    else:
        low = 0.5 * distance - c * math.atanh(height / length)
        at_foot = -c * math.sinh(low / c)
        forward = low + c * np.arcsinh((s + at_foot) / c)
        up = np.hypot(s + at_foot, c) - math.hypot(at_foot, c)
        slope = np.arctan2(s + at_foot, c)
    position = np.column_stack([forward * math.cos(heading), forward * math.sin(heading), -up])
    pitch = np.column_stack([np.cos(0.5 * slope), 0.0 * s, np.sin(0.5 * slope), 0.0 * s])
    a, b = math.cos(0.5 * heading), math.sin(0.5 * heading)
    attitude = np.column_stack([a * pitch[:, 0], -b * pitch[:, 2], a * pitch[:, 2], b * pitch[:, 0]])
    position[-1] = top
    return position, attitude
