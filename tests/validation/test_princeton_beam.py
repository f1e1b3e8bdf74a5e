"""Dowell, E. H., and Traybar, J. J. (1975), An experimental study of the nonlinear stiffness of a rotor blade undergoing flap, lag and
twist deformations, Princeton University, AMS reports 1194 and 1257: the Princeton beam, beside a shooting solution."""

import math

import numpy as np
import pytest
from pipe_helpers import bar, rotation, straight
from rods import at_tip, cantilever, clamped

HEIGHT, WIDTH, YOUNG, POISSON = 12.3777e-3, 3.2024e-3, 71.7e9, 0.31

PRINCETON = {
    "axial": YOUNG * HEIGHT * WIDTH,
    "shear": YOUNG / (2 + 2 * POISSON) * HEIGHT * WIDTH * 5 / 6,
    "torsion": YOUNG / (2 + 2 * POISSON) * HEIGHT * WIDTH**3 * (1 / 3 - 0.21 * WIDTH / HEIGHT * (1 - (WIDTH / HEIGHT) ** 4 / 12)),
    "bending": YOUNG * HEIGHT * WIDTH**3 / 12,
    "bending_3": YOUNG * WIDTH * HEIGHT**3 / 12,
}

PRINCETON_FIGURES = {  # tip load [N], its angle to the stiff direction [degrees]: tip displacements [m] chordwise and flapwise
    (8.896, 0): (1.071417630e-2, 0.0),
    (8.896, 15): (1.061328706e-2, 4.208232124e-2),
    (8.896, 30): (1.011169630e-2, 7.939482948e-2),
    (8.896, 45): (8.837226265e-3, 0.108987937),
    (8.896, 60): (6.604665004e-3, 0.129887616),
    (8.896, 75): (3.538889001e-3, 0.142194370),
    (8.896, 90): (0.0, 0.146245978),
    (13.345, 0): (1.606423724e-2, 0.0),
    (13.345, 15): (1.645825752e-2, 6.435812858e-2),
    (13.345, 30): (1.665873206e-2, 0.117735994),
    (13.345, 45): (1.518618440e-2, 0.156467239),
    (13.345, 60): (1.157837500e-2, 0.181861627),
    (13.345, 75): (6.248967384e-3, 0.196097131),
    (13.345, 90): (0.0, 0.200677707),
}


@pytest.mark.parametrize(("force", "angle"), PRINCETON_FIGURES)
def test_princeton_beam_experiment(force, angle):
    """Dowell and Traybar (1975): aluminium strip, tip weights of 8.896 and 13.345 N at 0 to 90 degrees to its stiff direction.

    Published tip displacements: Ansys beam elements by Obrezkov et al. (Nonlinear Dynamics 109, 2022), as quoted in Exudyn's test models,
    for 508 x 12.3777 x 3.2024 mm, E = 71.7 GPa, nu = 0.31; shear and torsion factors not given, here 5/6 and Roark's: within 1.5 %
    chordwise, 0.25 % flapwise. Against shooting, the tip's twist included: 4e-5 m and 2e-4 rad with 12 elements.
    """
    s, line = bar(0.508, 13, **PRINCETON)
    radians = math.radians(angle)
    load = force * np.array([0.0, math.cos(radians), math.sin(radians)])
    at = straight(s)
    for part in (0.25, 0.5, 0.75, 1.0):
        at = clamped(line, *at, at_tip(13, part * load))
    stiffness = [PRINCETON[key] for key in ("axial", "shear", "shear", "torsion", "bending", "bending_3")]
    exact, tip = cantilever(0.508, stiffness, at[1][-1], load)
    np.testing.assert_allclose(at[0][-1], exact, atol=4e-5)
    np.testing.assert_allclose(rotation(at[1][-1]), rotation(tip), atol=2e-4)
    chordwise, flapwise = PRINCETON_FIGURES[force, angle]
    assert at[0][-1, 1] == pytest.approx(chordwise, rel=0.015, abs=1e-9)
    assert at[0][-1, 2] == pytest.approx(flapwise, rel=2.5e-3, abs=1e-9)
