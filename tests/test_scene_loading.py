"""A scene is read, changed and refused as the command line promises: one line that names key, value and rule."""

import math

import numpy as np
import pytest

from master.scene import reading
from master.scene.reading import SceneError
from master.scene.sections import Load, TopMotion, mean_load

MINIMAL = """
[simulation]
duration = 300.0
macro_step = 0.1
[start]
x = 800.0
[environment]
[pipe]
length = 1200.0
"""


@pytest.fixture
def file(tmp_path):
    def write(content: str, name: str = "mine.toml") -> str:
        path = tmp_path / name
        path.write_bytes(content.encode("utf-8"))
        return str(path)

    return write


@pytest.mark.parametrize("name", ["paper", "pipelay", "free-decay", "heave"])
def test_built_in_scenes_are_listed_and_load(name):
    assert reading.built_in()[name]
    assert reading.load(name).name == name


def test_a_change_replaces_one_value_and_may_add_a_table():
    changed = reading.load("paper", ["simulation.duration=60", "vessel.controller.x = 790.0", "pipe.seabed={}"])
    assert changed.sections.simulation.duration == 60.0
    assert changed.mapping["vessel"]["controller"] == {"x": 790.0, "y": 0.0, "start": 30.0}
    assert changed.mapping["pipe"]["seabed"] == {}
    assert changed.mapping["pipe"]["length"] == 1200.0


@pytest.mark.parametrize("change", ["simulation.duration=5", "simulation.recording_step=0.01", "simulation.recording_step=1e3"])
def test_one_change_of_the_duration_or_the_recording_is_enough(change):
    reading.load("paper", [change])


BAD_CHANGES = {
    "unknown section": ("simulaton.duration=1", "simulaton = ", "did you mean simulation?"),
    "unknown key": ("simulation.duraton=1", "simulation.duraton = 1", "did you mean duration?"),
    "not a number": ('simulation.duration="long"', "simulation.duration = 'long'", "must be a number"),
    "a truth value for a number": ("simulation.duration=true", "simulation.duration = True", "must be a number"),
    "not finite": ("simulation.duration=nan", "simulation.duration = nan", "must be finite"),
    "infinite": ("start.x=inf", "start.x = inf", "must be finite"),
    "negative": ("simulation.duration=-5", "simulation.duration = -5", "must be > 0 s"),
    "zero step": ("simulation.macro_step=0", "simulation.macro_step = 0", "must be > 0 s"),
    "step beyond the end": ("simulation.macro_step=400", "macro_step = 400", "must be <= duration"),
    "not a list": ("simulation.snapshots=30", "simulation.snapshots = 30", "must be a list"),
    "unknown scheme": ('coupling.scheme="jacobi"', "coupling.scheme = 'jacobi'", "must be one of"),
    "loose tolerance": ("coupling.tolerance=2", "coupling.tolerance = 2", "must be < 1"),
    "degrees for radians": ("start.departure=67.4", "start.departure = 67.4", "must be <= 3.14"),
    "a number for a table": ("pipe.length.x=1", "pipe.length = 1200.0", "no table"),
    "a value for a section": ("pipe=1", "pipe = 1", "must be a table"),
    "height of a floating vessel": ("start.z=-800", "start.z = -800", "must be absent"),
    "motion of a vessel's pipe": ("top_motion={amplitude=[0,0,1],period=9}", "top_motion", "must be absent"),
    "short vector": ("tables.environment=[{time=0,force=[1,2]}]", "environment[1].force", "must have 3 values"),
    "table out of order": ("tables.environment=[{time=5},{time=2}]", "environment[2].time = 2", "must be > 5 s"),
    "empty table": ("tables.environment=[]", "tables.environment = []", "at least one row"),
    "text without quotes": ("pipe.top=pinned", "pipe.top=pinned", "in quotes"),
    "no value": ("pipe.top", "--set pipe.top", "must be key=value"),
}


@pytest.mark.parametrize("key", reading.FOUND)
def test_what_the_equilibrium_sets_is_refused_in_a_scene(key):
    with pytest.raises(SceneError, match=rf"^{key}: .*; must be absent$"):
        reading.load("paper", [f"{key}=[1.0, 2.0, 3.0]"])


@pytest.mark.parametrize(("change", "named", "rule"), BAD_CHANGES.values(), ids=BAD_CHANGES)
def test_a_bad_change_is_named_in_one_line(change, named, rule):
    with pytest.raises(SceneError) as caught:
        reading.load("paper", [change])
    message = str(caught.value)
    assert named in message
    assert rule in message
    assert "\n" not in message


BAD_FILES = {
    "syntax": ("[simulation\nduration = 1", "mine.toml", "line 1"),
    "suffix": (MINIMAL, "mine.yaml", "must end in .toml"),
    "without a vessel or a height": (MINIMAL, "mine.toml", "start.z: must be given without [vessel], for the height"),
    "without a start": (
        MINIMAL.replace("[start]\nx = 800.0", "[vessel]"),
        "mine.toml",
        "start: must be given",
    ),
    "pipe alone without a height": (
        MINIMAL + "[top_motion]\namplitude = [0, 0, 1]\nperiod = 12",
        "mine.toml",
        "start.z: must be given",
    ),
}


@pytest.mark.parametrize(("content", "name", "rule"), BAD_FILES.values(), ids=BAD_FILES)
def test_a_bad_file_is_named_in_one_line(file, content, name, rule):
    with pytest.raises(SceneError) as caught:
        reading.load(file(content, name))
    assert rule in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_no_text_is_refused(tmp_path):
    path = tmp_path / "binary.toml"
    path.write_bytes(b"title = \xff\xfe")
    with pytest.raises(SceneError, match="must be UTF-8"):
        reading.load(str(path))


@pytest.mark.parametrize("name", ["missing.toml", "no/such/folder/scene.toml"])
def test_a_missing_file_is_named(name):
    with pytest.raises(SceneError, match=r"scene = '.*toml': no such file"):
        reading.load(name)


def test_a_misspelt_built_in_name_gets_the_nearest_one():
    with pytest.raises(SceneError, match=r"scene = 'papr': unknown built-in scene \(did you mean paper\?\)"):
        reading.load("papr")


def test_mean_velocities_add_up_to_the_displacement():
    motion = TopMotion(amplitude=(1.0, 0.0, -2.0), period=12.0, ramp=24.0)
    steps = [0.1] * 100 + [0.05] * 33
    time, moved = 0.0, np.zeros(3)
    for step in steps:
        moved += step * motion.mean_velocity(time, step)
        time += step
    np.testing.assert_allclose(moved, motion.displacement(time), atol=1e-14)
    np.testing.assert_allclose(motion.displacement(27.0), (1.0, 0.0, -2.0), rtol=1e-14)


def test_mean_load_is_the_integral_of_the_broken_line():
    rows = (Load(0.0, (0.0, 0.0, 0.0)), Load(1.0, (2.0, 0.0, 0.0)), Load(3.0, (0.0, 0.0, 4.0), (0.0, 6.0, 0.0)))
    force, moment = mean_load(rows, 0.5, 1.5)
    np.testing.assert_allclose(force, (1.5 * 0.5 + 1.5 * 1.0, 0.0, 1.0) / np.float64(1.5))
    np.testing.assert_allclose(moment, (0.0, 1.5 / 1.5, 0.0))
    np.testing.assert_allclose(mean_load(rows, 9.0, 1.0)[1], (0.0, 6.0, 0.0))
    assert math.isclose(mean_load(rows, -2.0, 1.0)[0][0], 0.0)
