"""A line that sinks: its terminal velocity, and how it gets there, in closed form."""

import math

import numpy as np
import pytest
from pipe_helpers import bar, free_step, loaded, straight
from rods import UPRIGHT

from pipe_fmu.line import Water


@pytest.mark.parametrize("along", [False, True])
def test_sinking_line_reaches_its_terminal_velocity(along):
    """v = sqrt(w / (rho d D / 2)) across and along; from rest v(t) = v tanh(w t / (m v))."""
    weight, mass, across, lengthwise = 300.0, 40.0, 120.0, 3.0
    s, line = bar(60.0, 7, axial=1e8, shear=1e10, torsion=1e9, bending=1e9, mass=mass, weight=weight)
    line = loaded(line, drag=np.tile([lengthwise, across], (6, 1)))
    position, attitude = straight(s, (0.0, 0.0, -1.0), UPRIGHT) if along else straight(s)
    terminal = math.sqrt(weight / (lengthwise if along else across))
    water = Water(np.zeros(0), np.zeros((0, 3)), True)
    fall = np.tile([0.0, 0.0, terminal], (7, 1))
    state = free_step(line, (position, attitude, fall, np.zeros((7, 3))), 0.5, water)
    np.testing.assert_allclose(state[2], fall, atol=1e-8 * terminal)
    end = 1.5 * mass * terminal / weight
    speeds = []
    for count in (10, 20):
        state = position, attitude, np.zeros((7, 3)), np.zeros((7, 3))
        for _ in range(count):
            state = free_step(line, state, end / count, water)
        speeds.append(state[2][3, 2])
    exact = terminal * math.tanh(1.5)
    assert speeds[1] == pytest.approx(exact, rel=2e-3)
    assert abs(speeds[0] - exact) / abs(speeds[1] - exact) > 3.5  # second order
