"""The state of a pipe."""

from typing import NamedTuple

from .. import loads
from ..arrays import Array

LEDGER = {  # ports of energies and works: what they are, and the least they can be
    "kinetic_energy": ("kinetic energy", 0.0),
    "elastic_energy": ("strain energy", 0.0),
    **loads.LEDGER,
    "rotational_dissipation": ("energy dissipated by rotational damping since the start", 0.0),
    "internal_dissipation": ("energy dissipated by internal damping since the start", 0.0),
    "numerical_dissipation": ("energy dissipated by numerical damping since the start", 0.0),
}
ENERGIES = tuple(port.removesuffix("_energy") for port in LEDGER if port.endswith("_energy"))
WORKS = tuple(port.rpartition("_")[0] for port in LEDGER if not port.endswith("_energy"))
ROTATIONAL, INTERNAL, NUMERICAL = (WORKS.index(name) for name in ("rotational", "internal", "numerical"))


class PipeState(NamedTuple):
    """Everything that decides the next step; never changed once made."""

    time: float  # s
    position: Array  # (n, 3) phi [m], e
    quaternion: Array  # (n, 4) attitude of the sections
    velocity: Array  # (n, 3) of the centres of the nodes' masses [m/s], e
    rate: Array  # (n, 3) angular velocity [rad/s], material
    added_mass_velocity: Array  # (n, 3) velocity of the added mass [m/s], material; (0, 3) when absent
    strain: Array  # (n - 1, 7) strains and sags
    last: Array  # (n, 6) mean velocities of the last step, for the extrapolation
    before: Array  # (n, 6) those of the step before
    earlier: Array  # (n, 6) and of the one before that
    top_work: float  # work done on the pipe at its top since the start [J]
    works: Array  # (len(WORKS),) works and dissipations since the start [J], in their order


# numba knows a type within a tuple by its name: a pipe of another package in the process (an FMU brings its own) must not pass for this
PipeState.__name__ = f"{__package__}.{PipeState.__name__}"
