"""Bickley, W. G. (1934), The heavy elastica, Phil. Mag. 17, and Rohde, F. V. (1953), Large deflections of a cantilever beam with uniformly
distributed load, Q. Appl. Math. 11: a cantilever under its own weight, beside a shooting solution."""

import math

import numpy as np
import pytest
from pipe_helpers import bar, loaded, straight
from rods import cantilever, clamped, order


@pytest.mark.parametrize(("weight", "tolerance"), [(1.0, 5e-7), (10.0, 6e-5), (100.0, 1.2e-3)])
def test_heavy_elastica(weight, tolerance):
    """Horizontal cantilever under its own weight (Bickley 1934, Rohde 1953), w L^3 / EI = 1, 10 and 100, against shooting: fourth order.

    The first is near the w L^4 / 8 EI of small slopes: the tip sinks by 0.1235 L (0.125).
    """
    bending, length = 1e3, 10.0
    stiff = {"axial": 1e7, "shear": 1e7, "torsion": bending, "bending": bending}
    tips = []
    for n in (9, 17):
        s, line = bar(length, n, **stiff)
        at = straight(s)
        for part in np.geomspace(0.5 / weight, 1.0, 2 + round(6 * math.log(weight + 1.0))):
            own = loaded(line, weight=np.full(n - 1, part * weight * bending / length**3))
            at = clamped(own, *at, limit=100)
        tips.append(at[0][-1])
    exact, _ = cantilever(length, [1e7] * 3 + [bending] * 3, at[1][-1], load=(0.0, 0.0, weight * bending / length**3))
    np.testing.assert_allclose(tips[0], exact, atol=tolerance * length)
    assert order(*tips, exact) > 3.5
    if weight == 1.0:
        assert exact[2] == pytest.approx(0.125 * length, rel=0.015)
