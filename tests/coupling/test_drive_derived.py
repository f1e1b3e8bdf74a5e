"""What a run derives from the ports: the tension at the top and the gap between the two units' poses."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from master.run.pipe_drive import pose_gap, top_tension


class Ports:
    """Ports by name."""

    def __init__(self, **ports):
        self.ports = {name: np.asarray(value, dtype=float) for name, value in ports.items()}

    def get(self, names):
        return np.concatenate([self.ports[name] for name in names])


def scalar_first(rotation):
    return np.roll(rotation.as_quat(), 1)


@pytest.mark.parametrize("seed", range(4))
def test_top_tension_is_the_force_on_the_pipe_along_its_axis(seed):
    random = np.random.default_rng(seed)
    turn, on_pipe = Rotation.random(random_state=seed), random.normal(size=3)
    pipe = Ports(end_force=-on_pipe, top_quaternion=scalar_first(turn))
    assert top_tension(pipe)["top_tension", "N"] == pytest.approx(turn.as_matrix()[:, 0] @ on_pipe, abs=1e-12)


@pytest.mark.parametrize("angle", [1e-9, 0.3, 3.0])
def test_pose_gap_is_the_distance_and_the_angle_between_the_two_poses(angle):
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    held = Rotation.from_euler("ZYX", [0.7, -1.1, 0.4])
    holding = Rotation.from_rotvec(angle * axis) * held
    pipe = Ports(top_position=[1.0, 2.0, -3.0], top_quaternion=scalar_first(held))
    vessel = Ports(hang_off_position=[1.0, 5.0, 1.0], hang_off_quaternion=-scalar_first(holding))
    gap = pose_gap(pipe, vessel)
    assert gap["pose_gap", "m"] == pytest.approx(5.0)
    assert gap["pose_gap_angle", "rad"] == pytest.approx(angle, rel=1e-6)
    assert ("pose_gap_angle", "rad") not in pose_gap(pipe, vessel, clamped=False)
