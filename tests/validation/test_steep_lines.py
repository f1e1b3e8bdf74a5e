"""Elements stay right side out, eq. (1): lines that hang down from either end to a narrow bend, and what is refused."""

import math

import numpy as np
import pytest
import reference_bvp
from pipe_helpers import STILL, bar, pitch, started
from statics_grid import differences, figures
from steep_lines import equilibrium, least_advance, lines

from pipe_fmu import Pipe, PipeParameters, PipeUnit, Section
from pipe_fmu.environment import Environment
from pipe_fmu.native import MESSAGES
from pipe_fmu.statics import solve
from pipe_fmu.statics.balance import Scales
from pipe_fmu.step import integrator

PLUMB = PipeParameters(
    length=1200.0,
    section=Section(wall_thickness=0.025),
    foot="pinned",
    top="pinned",
    top_position=(0.001, 0.0, -800.0),
    environment=Environment(depth=810.0),
)


@pytest.mark.parametrize("nodes", [24, 48, 96, 192])
def test_a_line_pinned_a_millimetre_aside_of_plumb_is_that_of_the_boundary_value_problem(nodes):
    """1000 m hang from the top and 200 m from the foot: 1.00 and 0.20 MN."""
    found = reference_bvp.solve(reference_bvp.Tube(0.4064, 0.025), 1200.0, 0.001, 800.0, foot="pinned", tolerance=1e-6)
    _, _, _, _, tension, _ = found.at([0.0, 1200.0])
    moment = np.abs(found.at(np.linspace(0.0, 1200.0, 5001))[3]).max()
    pipe, held = equilibrium(PLUMB, nodes)
    forces = pipe.section_forces(pipe.at_rest(held))
    assert held.stable
    np.testing.assert_allclose(forces.tension[[0, -1]], tension, rtol=1e-5)
    assert pipe.largest_bending_moment(forces) == pytest.approx(moment, rel=1e-3)


@pytest.mark.parametrize("number", range(12))
def test_a_random_steep_slack_line_is_right_side_out_and_that_of_a_mesh_four_times_finer(number):
    parameters = lines(12, 1)[number]
    coarse, fine = (equilibrium(parameters, nodes) for nodes in (48, 192))
    assert min(least_advance(found) for _, found in (coarse, fine)) > 0.3
    force, moment = differences(figures(*coarse), figures(*fine))
    assert force < 1e-4
    assert moment < 0.05 or least_advance(coarse[1]) < 0.9  # a cable's bend of 2 m within one element


def soft_in_shear(angle):
    """Line of two elements, its sections held along x by ends and bending, its chords at an `angle` [deg] that its shear hardly minds."""
    s, line = bar(20.0, 3, axial=1e6, shear=1.0, torsion=1e9, bending=1e9, weight=1e-3, inertia=1.0, foot_clamped=True, top_clamped=True)
    direction = np.array([math.cos(math.radians(angle)), 0.0, -math.sin(math.radians(angle))])
    return line, np.outer(s, direction), np.tile(pitch(0.0), (3, 1))


@pytest.mark.parametrize(("angle", "flaw"), [(80.0, ""), (100.0, "turned inside out")])
def test_an_equilibrium_with_a_chord_against_its_sections_is_none(angle, flaw):
    line, *pose = soft_in_shear(angle)
    found = solve.equilibrium(line, STILL, Scales(line), tuple(pose))
    assert found.residual < 1e-7
    assert found.flaw == flaw
    assert found.converged == (not flaw)
    assert found.stable == (not flaw)


@pytest.mark.parametrize(("angle", "flaw"), [(83.0, ""), (92.0, "turned inside out")])
def test_a_step_that_would_turn_an_element_inside_out_is_refused(angle, flaw):
    line, *pose = soft_in_shear(80.0)
    _, there, _ = soft_in_shear(angle)
    start = integrator.rest(line, *pose, 0.0)
    h = 0.1
    result = integrator.step(line, STILL, start, (there[-1] - pose[0][-1]) / h, np.zeros(3), h)
    assert result.flaw == flaw
    assert result.converged == (not flaw)
    assert (result.state is start) == bool(flaw)


def test_a_unit_says_that_an_element_is_turned_inside_out(monkeypatch):
    _, found, state = started(PLUMB)
    unit = PipeUnit(PLUMB)
    monkeypatch.setattr(Pipe, "start", lambda self, time: (found._replace(converged=False, flaw="turned inside out"), state))
    assert "an element is turned inside out" in unit.initialize(0.0, {})
    monkeypatch.undo()
    assert unit.initialize(0.0, {}) is None
    words = "step of %g s at t = %g s: an element would be turned inside out; more nodes may help"
    assert words in MESSAGES
