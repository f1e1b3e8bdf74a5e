"""A scene is read, changed and refused as the command line promises: one line that names key, value and rule."""

import math

import numpy as np
import pytest
from bad_scenes import BAD_CHANGES, MINIMAL

from master.scene import reading
from master.scene.reading import SceneError
from master.scene.sections import Load, TopMotion, mean_load


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
