"""The pipe as a co-simulation unit: names, units and meaning of its ports. Knows nothing of FMI; an adapter does the rest."""

from typing import Any, ClassVar

import numpy as np

from . import loads, native, validity
from .arrays import Array
from .model import resolve
from .notes import SIZE, texts
from .parameters import PipeParameters
from .pipe import Pipe
from .step.state import ENERGIES, LEDGER, PipeState
from .validity import QUIET
from .vectors import Now, loaded, state_size, store

Port = tuple[int, str | tuple[str, ...], str]

_MOTION = "of the hang-off point, mean over the coming step, in e"
UNSTABLE = native.UNSTABLE
_PULL = "of the pipe on the vessel at the hang-off point, in e"
_MOBILITY = 3 * (3 * ("m/(N.s)",) + 3 * ("1/(N.s)",)) + 3 * (3 * ("rad/(N.s)",) + 3 * ("rad/(N.m.s)",))
_IMPEDANCE = 3 * (3 * ("N.s/m",) + 3 * ("N.s/rad",)) + 3 * (3 * ("N.s",) + 3 * ("N.m.s/rad",))
_AT_LEAST_ZERO = (
    *(port for port, (_, least) in LEDGER.items() if least == 0.0),
    "pipe_length", "largest_bending_moment", "largest_von_mises", "largest_utilisation", "newton_iterations", "newton_residual", "s",
)  # fmt: skip


class PipeUnit:
    """A pipe whose top follows the velocity it is given and answers with its pull."""

    NAME = "pipe"
    DESCRIPTION = "Geometrically exact submerged pipe hanging from a moving point; energy-consistent step"
    PARAMETERS = PipeParameters
    INPUTS: ClassVar[dict[str, Port]] = {
        "velocity": (3, "m/s", f"velocity {_MOTION}"),
        "angular_velocity": (3, "rad/s", f"angular velocity {_MOTION}"),
        "mobility": (
            36,
            _MOBILITY,
            "zero, or what the hang-off point yields to the pull: d(velocities) / d(force, moment), row by row, SI; "
            "the velocities are then those without a pull",
        ),
    }
    RANGES: ClassVar[dict[str, tuple[float | None, float | None]]] = dict.fromkeys(_AT_LEAST_ZERO, (0.0, None))

    COUNTS: ClassVar[tuple[str, ...]] = ("newton_iterations",)  # outputs that are integers

    def __init__(self, parameters: PipeParameters) -> None:
        self._pipe = Pipe(parameters)
        self._unit, self.constants = self._pipe.unit, self._pipe.constants
        self._places = native.output_places(self._pipe.parameters)
        self._values_of: Any = None  # the state that the outputs are of
        self._values, self._known = np.empty(0), set[int]()
        self.remark = ""  # what the host's log should say of the start, or of the last step that was done; a line each
        self.state = self._stored(self._pipe.straight(), np.zeros(6), np.zeros((6, 6)), 0.0, QUIET)  # never changed, but replaced

    @property
    def parameters(self) -> PipeParameters:
        """The parameters, with the nodes placed."""
        return self._pipe.parameters

    def compile(self) -> None:
        """Run every kernel once."""
        notes, numbers = np.zeros(SIZE), native.values(self.parameters)
        native.unit_constants(self.constants, numbers, np.empty_like(self.constants), notes)
        native.unit_start(self.constants, self.constants, self.state, np.zeros(native.N_INPUTS), 0.0, np.empty_like(self.state), notes)
        self._stepped(0.0, 1e-3, np.zeros(native.N_INPUTS), notes)
        native.unit_outputs(self.constants, self.state, 0, np.empty(max(part.stop for part, _ in self._places.values())))

    def _stored(self, state: PipeState, top: Array, impedance: Array, residual: float, told: Array) -> Array:
        out = np.empty(state_size(len(self._pipe.s), self._pipe.parameters.added_mass is not None))
        store(state, top, impedance, 0, residual, told, out)
        return out

    @property
    def now(self) -> Now:
        """The state, unpacked."""
        now: Now = loaded(self.state, len(self._pipe.s), self._pipe.parameters.added_mass is not None)
        return now

    @staticmethod
    def outputs(parameters: PipeParameters) -> dict[str, Port]:
        """Output ports (size, unit, description); physics that is absent has none."""
        n = resolve(parameters).nodes
        ports: dict[str, Port] = {
            "force": (3, "N", f"force {_PULL}, mean over the step"),
            "moment": (3, "N.m", f"moment {_PULL}, mean over the step"),
            "force_change": (3, "N", f"force {_PULL}, mean over the step, less reference_force"),
            "moment_change": (3, "N.m", f"moment {_PULL}, mean over the step, less reference_moment"),
            "end_force": (3, "N", f"force {_PULL}, at the end of the step, without numerical damping"),
            "end_moment": (3, "N.m", f"moment {_PULL}, at the end of the step, without numerical damping"),
            "top_velocity": (3, "m/s", "velocity of the top, mean over the step, in e"),
            "top_angular_velocity": (3, "rad/s", "angular velocity of the top, mean over the step, in e"),
            "top_position": (3, "m", "position of the top, in e"),
            "top_quaternion": (4, "1", "attitude of the top section, scalar first"),
            "impedance": (36, _IMPEDANCE, "d(force, moment on the pipe) / d(velocity, angular velocity), row by row; of the last sub-step"),
        }
        absent = [port for port, present in _optional(parameters).items() if not present]
        booked: dict[str, Port] = {port: (1, "J", text) for port, (text, _) in LEDGER.items() if port not in absent}
        top_work: Port = (1, "J", "work done on the pipe at its top since the start")
        energies = {port: booked.pop(port) for port in ENERGIES if port in booked}
        ports |= energies | {"top_work": top_work} | booked
        ports |= {
            "pipe_length": (1, "m", "length of the stretched centreline"),
            "largest_tension": (1, "N", "largest effective tension at the nodes"),
            "largest_bending_moment": (1, "N.m", "largest bending moment, between the nodes too"),
            "largest_von_mises": (1, "Pa", "largest von Mises stress in the wall, between the nodes too"),
        }
        if _has_yield_stress(parameters):
            ports["largest_utilisation"] = (1, "1", "largest von Mises stress over the yield stress, between the nodes too")
        ports |= {
            "newton_iterations": (1, "1", "corrections of the last step"),
            "newton_residual": (1, "1", "residual of the last step over the largest element force and 1e-3 of the inertial ones"),
            "s": (n, "m", "arc length of the nodes"),
            "node_position": (3 * n, "m", "positions of the nodes, in e"),
            "node_tension": (n, "N", "effective tension at the nodes, without numerical damping"),
            "node_wall_tension": (n, "N", "force in the wall at the nodes: effective tension less that of the pressures"),
            "node_moment": (3 * n, "N.m", "torque and bending moments at the nodes, without numerical damping, material components"),
            "node_shear": (2 * n, "N", "shear forces at the nodes, without numerical damping, material components"),
        }
        return ports

    @staticmethod
    def nominal(parameters: PipeParameters) -> dict[str, float]:
        """Orders of magnitude by unit of measure: the length, the pipe's weight in air at an arm of a metre, steel's stress."""
        mass = sum(section.mass_per_length * (section.length or parameters.length) for section in parameters.all_sections)
        weight = mass * parameters.environment.gravity
        return {"m": parameters.length, "m/s": 1.0, "rad/s": 0.1, "N": weight, "N.m": weight, "J": weight, "Pa": 1e8}

    def initialize(self, time: float, inputs: dict[str, Array]) -> str | None:
        """Find the static equilibrium; a message if there is none."""
        found, state = self._pipe.start(time)
        if not found.converged:
            return f"statics: no equilibrium: {found.unbalance(self._pipe.s)}"
        notes, told = np.zeros(SIZE), QUIET.copy()
        native.look(self._unit, state, told, notes)
        self.state = self._stored(state, found.top, found.stiffness, found.residual, told)
        self._stepped(time, 1e-3, np.zeros(native.N_INPUTS), np.zeros(SIZE))  # compiling it belongs to the start
        remarks = [] if found.stable else [UNSTABLE]
        self.remark = "\n".join([*remarks, *validity.of_parameters(self._pipe.parameters), *texts(notes, native.MESSAGES)])
        return None

    def step(self, time: float, h: float, inputs: dict[str, Array]) -> str | None:
        """Advance by h [s]; a message, and the state unchanged, if Newton's method does not converge, nor in sub-steps if allowed."""
        notes = np.zeros(SIZE)
        status, after = self._stepped(time, h, np.concatenate([inputs[name] for name in self.INPUTS]), notes)
        words = "\n".join(texts(notes, native.MESSAGES))
        if status:
            return words
        self.state, self.remark = after, words
        return None

    def _stepped(self, time: float, h: float, inputs: Array, notes: Array) -> tuple[int, Array]:
        after = np.empty_like(self.state)
        return native.unit_step(self.constants, inputs, time, h, self.state, after, notes), after

    def output(self, name: str) -> Array:
        """Values (size,) of a port, computed when first asked for in a state."""
        place, group = self._places[name]
        if self._values_of is not self.state:
            size = max(part.stop for part, _ in self._places.values())
            self._values_of, self._values, self._known = self.state, np.empty(size), set()
        if group not in self._known:
            native.unit_outputs(self.constants, self.state, group, self._values)
            self._known.add(group)
        return self._values[place]


def _has_yield_stress(parameters: PipeParameters) -> bool:
    return any(section.yield_stress is not None for section in parameters.all_sections)


def _optional(parameters: PipeParameters) -> dict[str, bool]:
    return {
        **loads.present(parameters),
        "internal_dissipation": parameters.internal_damping > 0.0,
        "numerical_dissipation": parameters.numerical_damping > 0.0,
    }
