"""Statics from the scene alone over the whole grid of lines, nearly vertical to nearly taut; a sample of them solved independently."""

import math
from dataclasses import replace

import numpy as np
import pytest
import reference_bvp
from pipe_helpers import pitch, rotation, started
from statics_grid import equilibrium, scenes

SCENES = scenes()
NODES = {192: 64}  # a hose that bends within 0.3 m: on 48 nodes, 200 m apart, its turned top is led to no shape at rest


@pytest.mark.parametrize("scene", SCENES, ids=[scene.name for scene in SCENES])
def test_a_line_finds_a_stable_equilibrium_with_its_top_hanging_and_turned(scene):
    pipe, hung, held = equilibrium(scene, NODES.get(SCENES.index(scene), 48))
    assert hung.converged
    assert hung.stable
    assert held.converged
    assert held.stable
    weight = pipe.line.loads.weight @ pipe.line.length
    if pipe.parameters.seabed is None and pipe.parameters.environment.current is None:  # what hangs is held by its ends
        assert -(held.top[2] + held.foot[2]) == pytest.approx(weight, rel=1e-6)


TUBES = {"12 in": "P12", "16 in": "P16", "30 in": "P30"}


def solution(number, top_angle=None):
    """Boundary value problem of a scene; the reference must meet its own end conditions."""
    p = SCENES[number].parameters
    x, _, z = p.top_position
    tube = reference_bvp.TUBES[TUBES[SCENES[number].name.split(": ")[1].split(",")[0]]]
    current = p.environment.current
    speed = 0.0 if current is None else current.velocity[1]
    found = reference_bvp.solve(tube, p.length, x, -z, top_angle, p.foot, speed, p.environment.depth, p.seabed is not None, 1e-6)
    ends = found.at([0.0, p.length])[0]
    np.testing.assert_allclose(ends, np.array([[0.0, 0.0, 0.0], p.top_position]).T, atol=1e-5 * p.length)
    return found


@pytest.mark.parametrize("number", [12, 15, 24, 33, 54, 63, 72, 93, 99, 102, 105, 117])
def test_a_hanging_line_of_the_grid_is_that_of_the_boundary_value_problem(number):
    """12, 16 and 30 in; 300 to 3000 m; 0.3 to 0.995 of taut; bed, current, pinned foot each on and off: the top's force."""
    _, hung, _ = equilibrium(SCENES[number])
    force = solution(number).at([SCENES[number].parameters.length])[2][:, 0]
    assert np.linalg.norm(hung.top[:3] - force) < 1e-4 * np.linalg.norm(force)


@pytest.mark.parametrize("number", [24, 36, 66, 72, 78, 99, 102])
def test_a_turned_line_of_the_grid_is_that_of_the_boundary_value_problem(number):
    """Top section turned in the line's plane by 30 or 60 degrees either way, on 64 nodes placed for it: the top's force, and its moment.

    The largest error, 9e-5 for the top of a taut line turned by 30 degrees (99: sheared by 3e-3), is that of measuring the extension along
    the centreline and not along t_1, as element/strains.py states; 768 nodes leave 7.6e-5.

    A short, stiff line that is pressed together (93) rests bent to either side, and which it is depends on its mesh: not among these.
    """
    _, hung, _ = equilibrium(SCENES[number])
    first = rotation(hung.quaternion[-1])[:, 0]
    angle = math.atan2(-first[2], first[0]) + SCENES[number].turn[1]
    _, held, _ = started(replace(SCENES[number].parameters, nodes=64, top_quaternion=pitch(angle)))
    _, _, force, moment, _, _ = solution(number, angle).at([SCENES[number].parameters.length])
    assert held.stable
    assert np.linalg.norm(held.top[:3] - force[:, 0]) < 1e-4 * np.linalg.norm(force)
    assert held.top[4] == pytest.approx(moment[1, 0], rel=5e-3)
