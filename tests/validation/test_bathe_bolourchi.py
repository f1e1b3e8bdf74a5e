"""Bathe, K.-J., and Bolourchi, S. (1979), Large displacement analysis of three-dimensional beam structures, Int. J. Numer. Methods Eng. 14:
the 45-degree bend, beside a shooting solution."""

import math

import numpy as np
import pytest
from pipe_helpers import bar, rotation_vector_quaternion, times
from rods import at_tip, cantilever, clamped, extrapolated, order

BEND = {"axial": 1e7, "shear": 5e6, "torsion": 5e6 / 6, "bending": 1e7 / 12}
BEND_FIGURES = {  # tip across, along and out of the plane
    300.0: {
        "Bathe and Bolourchi 1979": (22.5, 59.2, 39.5),
        "Simo and Vu-Quoc 1986": (22.33, 58.84, 40.08),
        "Cardona and Geradin 1988": (22.14, 58.64, 40.35),
        "Crisfield 1990": (22.16, 58.53, 40.53),
        "converged": (22.2448, 58.7791, 40.1919),
    },
    600.0: {
        "Bathe and Bolourchi 1979": (15.9, 47.2, 53.4),
        "Simo and Vu-Quoc 1986": (15.79, 47.23, 53.37),
        "Cardona and Geradin 1988": (15.55, 47.04, 53.50),
        "Crisfield 1990": (15.61, 46.84, 53.71),
        "converged": (15.6848, 47.1504, 53.4749),
    },
}


def bend(sides, load):
    """Tip of the 45-degree bend of radius 100 as a polygon of straight lines joined rigidly: across, along, out of the plane."""
    angle = math.pi / 4 / sides
    s, side = bar(200.0 * math.sin(0.5 * angle), 3, **BEND)
    headings = angle * (np.arange(sides) + 0.5)
    ways = np.column_stack([np.cos(headings), np.sin(headings), 0.0 * headings])
    corners = np.vstack([np.zeros(3), np.cumsum(ways, axis=0)]) * s[-1]
    position = np.concatenate([corner + np.outer(s, way) for corner, way in zip(corners, ways, strict=False)])
    attitude = np.repeat([rotation_vector_quaternion((0.0, 0.0, heading)) for heading in headings], 3, axis=0)
    for part in (0.25, 0.5, 0.75, 1.0):
        position, attitude = clamped([side] * sides, position, attitude, at_tip(2 * sides + 1, force=(0.0, 0.0, part * load)))
    return position[-1][[1, 0, 2]]


@pytest.mark.parametrize("load", BEND_FIGURES)
def test_bathe_and_bolourchi_45_degree_bend(load):
    """Bathe and Bolourchi (1979): radius 100, unit square, E = 1e7, G = 5e6, 45 degrees, load across its plane at the tip.

    Polygons of straight sides as in the source, two elements each. Shooting gives the converged figures to their last digit; eight sides
    come within 0.06 of them (300: 22.274, 58.782, 40.159; 600: 15.736, 47.149, 53.439), and 8 and 16 sides extrapolated within 5e-4.
    """
    stiffness = [BEND[key] for key in ("axial", "shear", "shear", "torsion", "bending", "bending")]
    trial = times(rotation_vector_quaternion((0.0, -0.8, 0.0)), rotation_vector_quaternion((0.0, 0.0, 0.25 * math.pi)))
    exact = cantilever(25.0 * math.pi, stiffness, trial, force=(0.0, 0.0, load), curvature=(0.0, 0.0, 0.01))[0][[1, 0, 2]]
    coarse, fine = bend(8, load), bend(16, load)
    np.testing.assert_allclose(exact, BEND_FIGURES[load]["converged"], atol=6e-5)
    for figure in BEND_FIGURES[load].values():
        np.testing.assert_allclose(coarse, figure, atol=0.75)
    np.testing.assert_allclose(coarse, exact, atol=0.06)
    np.testing.assert_allclose(extrapolated(coarse, fine), exact, atol=5e-4)
    assert order(coarse, fine, exact) == pytest.approx(2.0, abs=0.05)
