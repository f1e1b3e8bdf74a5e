"""The state of a pipe."""

from typing import NamedTuple

from .line import Array

WORKS = ("drag", "current", "rotational", "internal", "contact", "numerical")


class PipeState(NamedTuple):
    """Everything that decides the next step; never changed once made."""

    time: float  # s
    position: Array  # (n, 3) phi [m], e
    quaternion: Array  # (n, 4) attitude of the sections
    velocity: Array  # (n, 3) of the centres of the nodes' masses [m/s], e
    rate: Array  # (n, 3) angular velocity [rad/s], material
    flow: Array  # (n, 3) velocity of the added mass [m/s], material; (0, 3) when absent
    strain: Array  # (n - 1, 7) strains and sags
    last: Array  # (n, 6) mean velocities of the last step, for the extrapolation
    before: Array  # (n, 6) those of the step before
    earlier: Array  # (n, 6) and of the one before that
    top_work: float  # work done on the pipe at its top since the start [J]
    works: Array  # (6,) work or dissipation since the start [J], in the order of WORKS


# numba knows a type within a tuple by its name: a pipe of another package in the process (an FMU brings its own) must not pass for this
PipeState.__name__ = f"{__package__}.{PipeState.__name__}"
