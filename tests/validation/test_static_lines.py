"""Lines at rest that a search measured by the weight, or started from a hanging line, does not find: nearly neutral, lighter than water,
nearly inextensible, ending below where they begin, stretched, with buoyancy modules. Each against a solution of its own: elastica,
catenary, mirror image, bar.
"""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from pipe_helpers import HANGING, P16, balance, march
from random_lines import draw, settled
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

from pipe_fmu import Pipe, PipeParameters, PipeUnit, Seabed, Section
from pipe_fmu.environment import Environment

LONG = (8, 10)  # slack hoses on a bed in a current, a minute or more on the finer mesh: tests/support/random_lines.py runs them
pytestmark = pytest.mark.filterwarnings("error")


def pinned(length, top, section, depth=300.0, water=1025.0, **changes):
    """A line pinned at both ends in still water."""
    sea = Environment(depth=depth, water_density=water)
    ends = {"foot": "pinned", "top": "pinned", "top_position": top, "top_quaternion": HANGING}
    return PipeParameters(**({"length": length, "section": section, "environment": sea} | ends | changes))


def at_rest(parameters):
    """(pipe, its stable equilibrium with the top as it hangs)."""
    pipe = Pipe(parameters)
    found = pipe.equilibrium(parameters.top_position, None)
    assert found.converged
    assert found.stable
    return pipe, found


def neutral(mass):
    section = Section(outer_diameter=0.2, wall_thickness=0.05, mass=mass, displaced_area=0.025)
    return pinned(100.5, (60.0, 0.0, -80.0), section, 120.0, 1000.0)


def light(mass, top, **changes):
    """Line of hardly any bending stiffness; 6 and 10.1 kg/m are as much lighter and heavier than water as each other."""
    stiffness = {"axial_stiffness": 1e8, "shear_stiffness": 1e8, "torsional_stiffness": 1.0, "bending_stiffness": 1.0}
    displaced = 0.5 * (6.0 + 10.1) / 1025.0
    section = Section(outer_diameter=0.1, wall_thickness=0.02, mass=mass, displaced_area=displaced, **stiffness)
    return pinned(100.0, top, replace(section, rotational_inertia=(0.01, 0.005, 0.005)), 200.0, nodes=96, **changes)


def elastica(bending, axial, length, span):
    """Force that presses a bar, pinned at both ends, to a chord of `span`: the first mode of Euler's elastica, shortened by the force."""

    def chord(m):
        force = 4.0 * bending * ellipk(m) ** 2 / length**2
        return length * (2.0 * ellipe(m) / ellipk(m) - 1.0) - 0.5 * (1.0 + 2.0 * ellipe(m) / ellipk(m) - 1.0) * force * length / axial

    return 4.0 * bending * ellipk(brentq(lambda m: chord(m) - span, 1e-9, 0.9)) ** 2 / length**2


@pytest.mark.parametrize("mass", [24.99, 24.999, 24.9999, 25.0, 25.0001, 25.001, 25.01, 25.1])
def test_a_neutral_line_is_eulers_elastica_and_one_that_is_nearly_so_is_close_to_it(mass):
    """14.93 kN along the chord; the weight of the others, of -1 to 10 N, or 99 N, is a hundredth of that at most."""
    pipe, found = at_rest(neutral(mass))
    axial, _, _, bending, _ = pipe.parameters.section.stiffness
    force = elastica(bending, axial, 100.5, 100.0)
    assert force == pytest.approx(14930.0, abs=5.0)
    pressed = -(found.top[:3] - found.foot[:3]) @ [0.6, 0.0, -0.8] / 2.0
    assert pressed == pytest.approx(force, rel=2e-5 if mass == 25.0 else 0.015)
    assert found.top[:3] + found.foot[:3] == pytest.approx([0.0, 0.0, -(mass - 25.0) * 9.81 * 100.5], abs=1e-4)


def test_a_neutral_line_as_long_as_its_span_is_free_of_forces():
    _, found = at_rest(replace(neutral(25.0), length=100.0))
    assert np.abs(found.top).max() < 1e-3


@pytest.mark.parametrize("z", [-40.0, 0.0, 40.0])
@pytest.mark.parametrize("bed", [None, Seabed()])
def test_a_line_that_floats_is_the_mirror_image_of_one_that_hangs(z, bed):
    """70 m away, ending above, level with and below where it begins; a bed, if there is one, is touched by nothing but the foot."""
    if bed is not None and z > 0.0:
        pytest.skip("a line ends above its bed")
    _, floating = at_rest(light(6.0, (70.0, 0.0, z), seabed=bed))
    _, hanging = at_rest(light(10.1, (70.0, 0.0, -z)))
    mirror = np.array([1.0, 1.0, -1.0])
    size = np.linalg.norm(hanging.top[:3])
    np.testing.assert_allclose(floating.top[:3], mirror * hanging.top[:3], atol=(1e-5 if bed is None else 2e-4) * size)
    np.testing.assert_allclose(floating.foot[:3], mirror * hanging.foot[:3], atol=(1e-5 if bed is None else 2e-4) * size)
    if bed is None:  # and so the nodes are the same
        np.testing.assert_allclose(floating.position, mirror * hanging.position, atol=1e-3)
    if z == -40.0:
        np.testing.assert_allclose(floating.top[[0, 2]], [539.2, 539.6], rtol=1e-3)


@pytest.mark.parametrize("bed", [None, Seabed()])
def test_a_nearly_inextensible_line_is_the_catenary(bed):
    """EA = GA = 2e12 N, 200 N/m; 43.694 and 77.633 kN along and across at its top, 24.161 and 59.438 kN on the bed."""
    stiffness = {"axial_stiffness": 2e12, "shear_stiffness": 2e12, "torsional_stiffness": 1e3, "bending_stiffness": 1e3}
    section = Section(outer_diameter=0.1, wall_thickness=0.02, mass=28.4373, **stiffness)
    _, found = at_rest(pinned(500.0, (400.0, 0.0, -200.0), section, nodes=96, seabed=bed))
    w = (28.4373 - 1025.0 * math.pi * 0.0025) * 9.81
    if bed is None:
        c = 200.0 / brentq(lambda q: math.sinh(q) / q - math.sqrt(500.0**2 - 200.0**2) / 400.0, 0.1, 9.0)
        up = c * math.sinh(200.0 / c + math.atanh(200.0 / 500.0))
    else:
        c = brentq(lambda c: math.sqrt(200.0**2 + 400.0 * c) - c * math.acosh(1.0 + 200.0 / c) - 100.0, 1.0, 1e4)
        up = math.sqrt(200.0**2 + 400.0 * c)
    np.testing.assert_allclose(found.top[[0, 2]], [w * c, -w * up], rtol=2e-4)


def test_a_line_that_ends_below_where_it_begins_is_the_one_that_begins_there():
    """The ends change places, and so do their forces; 16 in, 1200 m, 700 m ahead, 300 m aside and 400 m down."""
    _, down = at_rest(pinned(1200.0, (700.0, 300.0, 400.0), P16, nodes=96))
    _, up = at_rest(pinned(1200.0, (-700.0, -300.0, -400.0), P16, nodes=96))
    np.testing.assert_allclose(down.top[:3], up.foot[:3], atol=1e-4 * np.linalg.norm(up.top[:3]))
    np.testing.assert_allclose(down.foot[:3], up.top[:3], atol=1e-4 * np.linalg.norm(up.top[:3]))


@pytest.mark.parametrize("span", [499.99, 500.0, 500.04, 502.0, 524.0])
def test_an_upright_riser_stretched_beyond_its_length_is_a_bar_under_its_weight(span):
    """T at mid length = EA (span / L - 1), and half the weight more and less at its ends."""
    pipe, found = at_rest(pinned(500.0, (0.0, 0.0, -span), P16, 600.0))
    weight = pipe.line.loads.weight @ pipe.line.length
    pull = P16.stiffness[0] * (span / 500.0 - 1.0)
    if pull > 0.5 * weight:
        np.testing.assert_allclose(-found.top[2], pull + 0.5 * weight, rtol=1e-7)
    np.testing.assert_allclose(-found.top[2] - found.foot[2], weight, rtol=1e-6)


def test_a_line_of_hardly_any_stiffness_stretched_across_the_water_is_the_elastic_catenary():
    """Span 500.04 m of 500 m, inclined: T along the chord of the elastic catenary, by its two end conditions (Irvine 1981)."""
    section = replace(P16, bending_stiffness=1.0)
    pipe, found = at_rest(pinned(500.0, (300.0, 0.0, -400.04), section, 600.0))
    w, axial = pipe.line.loads.weight[0], section.stiffness[0]
    position = elastic_catenary(w, axial, 500.0, found.top[0], -found.top[2])
    np.testing.assert_allclose(position, [300.0, 400.04], atol=1e-5)


def elastic_catenary(w, axial, length, along, up):
    """Where the top of an elastic catenary lies, ahead of and above its foot, under the force at its top."""
    foot = up - w * length
    ahead = along * length / axial + along / w * (math.asinh(up / along) - math.asinh(foot / along))
    return ahead, (up**2 - foot**2) / (2.0 * axial * w) + (math.hypot(along, up) - math.hypot(along, foot)) / w


def lazy_wave(seabed, lightness=80.0, reference=None, **changes):
    """1200 m of 16 in, 200 m of it with modules, in 550 m of water."""
    plain = replace(P16, length=500.0)
    bed = Seabed(reference_weight=reference) if seabed else None
    sections = (plain, replace(plain, length=200.0, mass=lightness), plain)
    return pinned(1200.0, (700.0, 0.0, -500.0), P16, 550.0, sections=sections, seabed=bed, **changes)


def test_modules_float_above_the_bed_and_carry_their_part_of_the_line():
    """Vertical balance of the free part, from where it leaves the bed to the top; the modules' ends each hang from them."""
    pipe, found = at_rest(lazy_wave(True, nodes=150))
    clear = found.position[:, 2] < -0.5 * P16.outer_diameter
    middle = np.flatnonzero((pipe.s > 550.0) & (pipe.s < 650.0))
    assert clear[middle].all()
    assert found.position[middle, 2].min() < found.position[np.searchsorted(pipe.s, 800.0), 2]
    first = int(np.flatnonzero(clear)[0])
    carried = pipe.line.loads.weight[first:] @ pipe.line.length[first:]
    state = pipe.at_rest(found)
    low = pipe.spatial(state, pipe.section_forces(state), first)
    assert -found.top[2] + low[2] == pytest.approx(carried, rel=1e-3)
    assert found.position[:, 2].max() < 0.15


def test_the_bed_under_modules_is_that_of_the_heaviest_section_or_of_the_weight_given():
    weight = lazy_wave(True).weight(P16)
    assert Pipe(lazy_wave(True)).line.loads.bed.bearing == pytest.approx(weight)
    assert Pipe(lazy_wave(True, reference=300.0)).line.loads.bed.bearing == pytest.approx(300.0)
    floats = pinned(1200.0, (700.0, 0.0, -500.0), replace(P16, mass=80.0), seabed=Seabed())
    assert Pipe(floats).line.loads.bed.bearing == pytest.approx(-floats.weight(floats.section))


def test_a_bed_under_a_line_without_weight_needs_the_weight_its_stiffness_follows_from():
    rule = "must be given where no section is heavier or lighter than water"
    with pytest.raises(ValueError, match=rf"^seabed\.reference_weight = nothing: {rule}$"):
        replace(neutral(25.0), seabed=Seabed())
    at_rest(replace(neutral(25.0), seabed=Seabed(reference_weight=100.0)))


def test_a_pipe_lies_at_zero_on_a_bed_for_its_weight_and_sinks_as_the_law_says_on_one_for_half_of_it():
    """p = z + d/8 with w_bed (p - d/40) / (d/10) = w: p = d/40 + d/5."""
    for reference, depth in ((None, 0.0), (0.5 * lazy_wave(True).weight(P16), P16.outer_diameter * (0.025 + 0.2 - 0.125))):
        parameters = pinned(1200.0, (800.0, 0.0, -300.0), P16, 550.0, seabed=Seabed(reference_weight=reference))
        pipe, found = at_rest(parameters)
        assert found.position[np.searchsorted(pipe.s, 250.0), 2] == pytest.approx(depth, abs=1e-3)


def test_a_line_with_modules_moves_over_its_bed_by_the_energy_identity():
    """It starts at rest, lying on a bed that is softer than its own weight asks for, and its top is moved to and fro."""
    pipe, found = at_rest(lazy_wave(True, reference=300.0, nodes=60))
    states, _ = march(pipe, pipe.at_rest(found), lambda t: (np.array([0.0, 0.0, 1.0 - math.cos(0.6 * t)]), 0.0), 0.1, 20)
    for old, new in pairwise(states):
        created, allowed = balance(pipe, old, new)
        assert abs(created) < allowed
    assert pipe.energies(states[0])[3] != pipe.energies(states[-1])[3]


def test_statics_that_find_nothing_name_the_residual_what_it_is_measured_by_and_where(monkeypatch):
    unit, (found, state) = PipeUnit(neutral(26.0)), Pipe(neutral(26.0)).start(0.0)
    lost = found._replace(converged=False, residual=2e-3, worst=47, iterations=9)
    monkeypatch.setattr(Pipe, "start", lambda self, time: (lost, state))
    message = unit.initialize(0.0, {})
    assert message == "statics: no equilibrium: residual 2.0e-03 of the weight or end force at s = 100.5 m after 9 corrections"


@pytest.mark.parametrize("number", [number for number in range(62) if number not in LONG])
def test_a_random_line_is_found_stable_not_inverted_and_right(number):
    """Sixty lines, against a mesh four times finer."""
    assert settled(draw(number)).faults == []
