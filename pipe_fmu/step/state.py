"""The state of a pipe."""

from typing import NamedTuple

from .. import loads
from ..arrays import Array, distinct
from ..compiled import kernel

LEDGER = {  # ports of energies and works: what they are, and the least they can be
    "kinetic_energy": ("kinetic energy", 0.0),
    "elastic_energy": ("strain energy", 0.0),
    **loads.LEDGER,
    "rotational_dissipation": ("energy dissipated by rotational damping since the start", 0.0),
    "internal_dissipation": ("energy dissipated by internal damping since the start", 0.0),
    "numerical_dissipation": ("energy dissipated by numerical damping since the start", 0.0),
}
ENERGIES = tuple(port for port in LEDGER if port.endswith("_energy"))
WORK_PORTS = tuple(port for port in LEDGER if port not in ENERGIES)
WORKS = tuple(port.rpartition("_")[0] for port in WORK_PORTS)
ROTATIONAL, INTERNAL, NUMERICAL = (WORKS.index(name) for name in ("rotational", "internal", "numerical"))


@distinct
class PipeState(NamedTuple):
    """Everything that decides the next step; never changed once made."""

    time: float  # s
    position: Array  # (n, 3) phi [m], e
    quaternion: Array  # (n, 4) attitude of the sections
    velocity: Array  # (n, 3) of the centres of the nodes' masses [m/s], e
    rate: Array  # (n, 3) angular velocity [rad/s], material
    added_mass_velocity: Array  # (n, 3) velocity of the added mass [m/s], material; (0, 3) when absent
    strain: Array  # (n - 1, 7) strains and sags
    chord: Array  # (n - 1, 4) of the elements [m], e, and their excess [m^2]; see element.strains.chords
    last: Array  # (n, 6) mean velocities of the last step, for the extrapolation
    before: Array  # (n, 6) those of the step before
    earlier: Array  # (n, 6) and of the one before that
    top_work: float  # work done on the pipe at its top since the start [J]
    works: Array  # (len(WORKS),) works and dissipations since the start [J], in their order


@kernel
def timed(state, time):
    """The state, taken for that at `time` [s]."""
    return PipeState(
        time, state.position, state.quaternion, state.velocity, state.rate, state.added_mass_velocity, state.strain,
        state.chord, state.last, state.before, state.earlier, state.top_work, state.works,
    )  # fmt: skip
