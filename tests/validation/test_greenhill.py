"""Greenhill, A. G. (1881), Determination of the greatest height consistent with stability that a vertical pole or mast can be made, Proc.
Camb. Phil. Soc. 4: a column that buckles under its own weight."""

import pytest
from pipe_helpers import bar, straight
from rods import UPRIGHT, critical, lowest


def test_self_buckling_of_a_standing_column():
    """w L^3 / EI = 7.8373 (Greenhill 1881), with eight elements to 1e-4."""
    length, bending, n = 10.0, 1e3, 9

    def value(weight):
        s, line = bar(length, n, axial=1e9, shear=1e9, torsion=bending, bending=bending, weight=weight * bending / length**3)
        return lowest(line, *straight(s, (0.0, 0.0, -1.0), UPRIGHT))

    assert critical(value, 7.0, 8.5) == pytest.approx(7.8373, rel=1e-4)
