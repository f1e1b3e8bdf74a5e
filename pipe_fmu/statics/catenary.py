"""Inextensible catenary between two points, free or partly lying on the bed: the shape from which the statics start."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LEAST_HEIGHT = 1e-6  # of the length: a top on the bed
_LEAST_BEND = 0.02  # of the height: horizontal force over weight per length where the line touches down, of a start
_TIGHTEST = 3.8  # largest heading [rad] of a meander: its chord has turned back


def parameter(length: float, distance: float, height: float, on_bed: bool) -> tuple[float, float]:
    """Horizontal force over weight per length, c [m], and length lying on the bed [m] of an inextensible line.

    The line has `length`, its top lies `distance` ahead of and `height` above its foot. With `on_bed` it does not hang below the foot.
    Infinite where it is not longer than its span.
    """
    if on_bed:
        height = max(height, LEAST_HEIGHT * length)
    distance = max(distance, 1e-6 * length)
    if is_straight(length, distance, height):
        return math.inf, 0.0
    ratio = math.sqrt(length**2 - height**2) / distance
    c = 0.5 * distance / _root(lambda q: _sinhc(q) - ratio, 1e-7, 700.0)
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


def tension(weight: float, axial: float, stretched: float) -> float:
    """Tension [N] of a nearly straight line of `weight` [N] across its chord and stiffness `axial` [N], its chord `stretched` times longer
    than it is at rest: what it is longer than its chord, weight^2 / (24 tension^2) of its length as in a parabola, it is stretched as well.
    """
    return _root(lambda t: t / axial - stretched - weight**2 / (24.0 * t**2), 1e-12 * axial, axial)


def is_straight(length: float, distance: float, height: float) -> bool:
    """Whether a line is no longer than its span, but for the last digits."""
    return length <= (1.0 + 1e-12) * math.hypot(distance, height)


def _sinhc(q: float) -> float:
    return math.sinh(q) / q


def _root(increasing: Callable[[float], float], low: float, high: float) -> float:
    """Root of a function between `low` and `high`, to the last bit, by bisection.

    The functions here cost microseconds; scipy's solvers would cost every exported unit half a second at its start, and 140 MB.
    """
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (low, middle) if increasing(middle) > 0.0 else (middle, high)
    return middle


def _meander(part: Array, span: float) -> tuple[Array, Array, Array]:
    """Sine-generated curve of unit length: (along its chord, aside of it, heading) at the parts (n,) of its length; `span` is its chord.

    Its heading, a sin(2 pi s), vanishes at both ends; the chord is J_0(a) (Langbein and Leopold 1966, USGS Prof. Paper 422-H), here the
    mean of cos(a sin) over a period, for which equal steps are exact.
    """
    fine = np.linspace(0.0, 1.0, 401)
    wave = np.sin(2.0 * math.pi * fine)
    amplitude = _root(lambda a: span - float(np.cos(a * wave[1:]).mean()), 0.0, _TIGHTEST) if span < 1.0 else 0.0
    heading = amplitude * wave
    along, aside = (np.concatenate([[0.0], np.cumsum(0.5 * (f[1:] + f[:-1]))]) / 400.0 for f in (np.cos(heading), np.sin(heading)))
    return np.interp(part, fine, along), np.interp(part, fine, aside), np.interp(part, fine, heading)


def shape(s: Array, length: float, top: tuple[float, float, float], on_bed: bool, floats: bool = False) -> tuple[Array, Array]:
    """Positions (n, 3) [m] and attitudes (n, 4) of the sections at arc lengths `s` (n,) of a line from the origin to `top`, in e.

    What lies on the bed and is longer than its span meanders. A line that `floats` is the mirror image of one that hangs; one that is
    shorter than its span is stretched to it.
    """
    distance, heading = math.hypot(top[0], top[1]), math.atan2(top[1], top[0])
    up_is, on_bed = (-1.0 if floats else 1.0), on_bed and not floats
    height = max(-top[2], LEAST_HEIGHT * length) if on_bed else -up_is * top[2]
    c, lying = parameter(length, distance, height, on_bed)
    aside, turn = np.zeros_like(s), np.zeros_like(s)
    if math.isinf(c):
        forward, up = s / length * distance, s / length * height
        slope = np.full_like(s, math.atan2(height, distance))
    elif lying > 0.0:
        c = max(c, min(_LEAST_BEND * height, 0.25 * (length - height)))
        lying = length - math.sqrt(height**2 + 2.0 * height * c)
        forward, aside, turn = _meander(np.minimum(s / lying, 1.0), (distance - c * math.acosh(1.0 + height / c)) / lying)
        hung = np.maximum(s - lying, 0.0)
        forward, aside = lying * forward + c * np.arcsinh(hung / c), lying * aside
        up = np.sqrt(hung**2 + c**2) - c
        slope = np.arctan2(hung, c)
    else:
        distance = max(distance, 1e-6 * length)
        low = 0.5 * distance - c * math.atanh(height / length)
        at_foot = -c * math.sinh(low / c)
        forward = low + c * np.arcsinh((s + at_foot) / c)
        up = np.hypot(s + at_foot, c) - math.hypot(at_foot, c)
        slope = np.arctan2(s + at_foot, c)
    ahead, across = math.cos(heading), math.sin(heading)
    position = np.column_stack([forward * ahead - aside * across, forward * across + aside * ahead, -up_is * up])
    turn, slope = 0.5 * (turn + heading), 0.5 * up_is * slope
    pitch, level = np.sin(slope), np.cos(slope)
    attitude = np.column_stack([np.cos(turn) * level, -np.sin(turn) * pitch, np.cos(turn) * pitch, np.sin(turn) * level])
    position[-1] = top
    return position, attitude
