"""What the units refuse in a scene: one line that names table, key, value and rule."""

import numpy as np
import pytest

from master.errors import UsageError
from master.scene import reading
from master.with_units.statics import equilibrium
from master.with_units.statics_report import report

BAD_VALUES = {
    "unknown key": ("pipe.section.diameter=0.4", "pipe.section.diameter = 0.4", "unknown key"),
    "misspelt key": ("pipe.section.wall_thicknes=0.02", "wall_thicknes = 0.02", "did you mean wall_thickness?"),
    "negative diameter": ("pipe.section.outer_diameter=-0.4", "pipe.section.outer_diameter = -0.4", "must be > 0 m"),
    "wall thicker than the radius": (
        "pipe.section.wall_thickness=0.9",
        "wall_thickness = 0.9",
        "outer radius 0.2032 m",
    ),
    "line too short": ("pipe.length=700", "pipe.length = 700", "must be at least 761.905 m"),
    "no length": ("pipe.length=0", "pipe.length = 0", "must be > 0 m"),
    "text for a number": ('pipe.length="long"', "pipe.length = 'long'", "must be a number"),
    "not a number": ("pipe.length=nan", "pipe.length = nan", "must be finite"),
    "infinite stiffness": ("pipe.section.youngs_modulus=inf", "youngs_modulus = inf", "must be finite"),
    "two nodes": ("pipe.nodes=2", "pipe.nodes = 2", "must be >= 3"),
    "a million nodes": ("pipe.nodes=1000001", "pipe.nodes = 1000001", "must be <= 100000"),
    "thruster too weak": (
        "vessel.controller.surge_limit=1000",
        "vessel.controller.surge_limit = 1000",
        "must be >= the hold thrust 3",
    ),
    "half a node": ("pipe.nodes=47.5", "pipe.nodes = 47.5", "must be an integer"),
    "unknown end": ('pipe.top="welded"', "pipe.top = 'welded'", "must be one of 'clamped', 'pinned'"),
    "negative drag": ("pipe.section.drag_normal=-1", "drag_normal = -1", "must be >= 0"),
    "impossible Poisson's ratio": ("pipe.section.poisson_ratio=0.6", "poisson_ratio = 0.6", "must be <= 0.5"),
    "sections of another length": ("pipe.sections=[{length=100}]", "pipe.length = 1200", "sum of the sections"),
    "section without length": ("pipe.sections=[{}]", "pipe.sections[1].length", "must be given"),
    "unknown bed": ("pipe.seabed={stiffness=1e5}", "pipe.seabed.stiffness = 100000", "unknown key"),
    "negative depth": ("environment.depth=-800", "environment.depth = -800", "must be > 0 m"),
    "text for a depth": ('environment.depth="deep"', "environment.depth = 'deep'", "must be a number"),
    "list for a depth": ("environment.depth=[800]", "environment.depth = [800]", "must be a number"),
    "top out of reach": ("start.x=1000", "start.x = 1000", "pipe.length = 1200 m can be stretched"),
    "top out of reach to the side": ("start.y=-1000", "start.y = -1000", "pipe.length = 1200 m can be stretched"),
    "section that is no table": ("pipe.sections=[1]", "pipe.sections[1] = 1", "must be a table"),
    "no gravity": ("environment.gravity=0", "environment.gravity = 0", "must be > 0 m/s2"),
    "unknown profile": ('environment.current.profile="sheared"', "profile = 'sheared'", "must be one of"),
    "current of two components": ("environment.current.velocity=[0, 1]", "velocity = [0, 1]", "must have 3 values"),
    "weightless vessel": ("vessel.mass=0", "vessel.mass = 0", "must be > 0 kg"),
    "hang-off in two components": ("vessel.hang_off=[0, 0]", "vessel.hang_off = [0, 0]", "must have 3 values"),
    "unstable controller": ("vessel.controller.integral_ratio=3", "vessel.controller.integral_ratio = 3", "unstable"),
    "unknown controller key": ("vessel.controller.kp=3", "vessel.controller.kp = 3", "unknown key"),
}


@pytest.mark.parametrize(("change", "named", "rule"), BAD_VALUES.values(), ids=BAD_VALUES)
def test_a_bad_value_is_named_in_one_line(change, named, rule):
    loaded = reading.load("paper", [change])
    with pytest.raises(UsageError) as caught:
        equilibrium(loaded)
    message = str(caught.value)
    assert named in message
    assert rule in message
    assert "\n" not in message
    assert not message.endswith(" 1")


def test_sections_have_from_the_common_section_what_they_do_not_say_themselves():
    changes = ["pipe.section.density=7000", "pipe.sections=[{length=300, density=7500}, {length=900}]", "pipe.nodes=12"]
    at = equilibrium(reading.load("paper", changes))
    lower, upper = at.pipe.sections
    assert (lower.density, upper.density) == (7500.0, 7000.0)
    assert lower.outer_diameter == upper.outer_diameter == 0.4064
    assert (lower.length, upper.length) == (300.0, 900.0)


def test_the_touchdown_is_that_of_the_section_that_lifts_off():
    """A thick first section lies higher on the bed than the pipe that leaves it at z = -d / 8."""
    thick = "{length=20, outer_diameter=1.2, wall_thickness=0.06}"
    found = report(reading.load("heave", ["pipe.seabed={}", f"pipe.sections=[{thick}, {{length=1180}}]", "start.x=780", "pipe.nodes=96"]))
    s, z = np.array(found["s_m"]), np.array(found["position_e_m"])[:, 2]
    assert found["touchdown_s_m"] > 20.0
    assert np.interp(found["touchdown_s_m"], s, z) == pytest.approx(-0.125 * 0.4064, rel=1e-9)


def test_the_report_has_the_bending_between_nodes_the_touchdown_between_nodes_and_no_round_off():
    found = report(reading.load("pipelay", ["start.x=780"]))
    assert found["largest_bending_moment_N_m"] >= max(found["bending_moment_N_m"])
    s, z = np.array(found["s_m"]), np.array(found["position_e_m"])[:, 2]
    assert np.interp(found["touchdown_s_m"], s, z) == pytest.approx(-0.125 * 0.4064, rel=1e-9)
    assert found["touchdown_s_m"] not in s
    # everything lies in the plane y = 0
    assert found["top_force_e_N"][1] == found["top_moment_e_N_m"][0] == found["foot_moment_e_N_m"][2] == 0.0
    assert found["hold_force_N"][1:] == [0.0, 0.0]
    assert not np.array(found["position_e_m"])[:, 1].any()
