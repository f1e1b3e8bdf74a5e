"""Statics from the scene alone over a grid of lines: 80 of the 200 scenes, from nearly vertical to nearly taut."""

import pytest
from statics_grid import equilibrium, scenes

SCENES = [scene for i, scene in enumerate(scenes()) if i % 5 in (2, 4)]
OPEN = ("124:", "182:", "194:", "197:")  # slack, in a current or with the top turned by 60 degrees: none found yet


@pytest.mark.parametrize(
    "scene",
    [pytest.param(it, marks=pytest.mark.xfail(strict=True)) if it.name.startswith(OPEN) else it for it in SCENES],
    ids=lambda scene: scene.name,
)
def test_a_line_finds_a_stable_equilibrium_with_its_top_hanging_and_turned(scene):
    pipe, hung, held = equilibrium(scene)
    assert hung.converged
    assert hung.stable
    assert held.converged
    assert held.stable
    weight = pipe.line.weight @ pipe.line.length
    if pipe.parameters.seabed is None and pipe.parameters.environment.current is None:  # what hangs is held by its ends
        assert -(held.top[2] + held.foot[2]) == pytest.approx(weight, rel=1e-6)
