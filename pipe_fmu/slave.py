"""The pipe as a co-simulation unit: names, units and meaning of its ports. Knows nothing of FMI; an adapter does the rest."""

from functools import partial
from typing import Any, ClassVar

import numpy as np

from . import loads, substeps, validity
from .arrays import Array
from .model import resolve
from .parameters import PipeParameters
from .pipe import Pipe
from .step.state import ENERGIES, LEDGER, WORK_PORTS

Port = tuple[int, str | tuple[str, ...], str]

_MOTION = "of the hang-off point, mean over the coming step, in e"
UNSTABLE = "statics: the equilibrium is not stable; the line will leave it at the least push"
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
        self.state: Any = (self._pipe.straight(), np.zeros(6), np.zeros((6, 6)), 0, 0.0, validity.QUIET)  # the layout; see `initialize`
        self.remark = ""  # what the host's log should say of the start, or of the last step that was done; a line each
        self._most, self._limits, self._yields = parameters.max_substeps, validity.limits(self._pipe), _has_yield_stress(parameters)
        self._reference = np.array([*parameters.reference_force, *parameters.reference_moment])
        self._memo: dict[str, Array] = {}
        self._memo_of: Any = None

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
        still = np.zeros(3)
        self._pipe.step(state, still, still, 1e-3)  # so that compiling its kernel belongs to the start, not to the first step
        self.state = (state, found.top, found.stiffness, 0, found.residual, validity.QUIET)
        remarks = [] if found.stable else [UNSTABLE]
        self.remark = "\n".join([*remarks, *validity.of_parameters(self._pipe.parameters), *self._look()])
        return None

    def _look(self) -> list[str]:
        """Remarks on the present state, if it is beyond a limit by more than was said; remembers in the state what it says."""
        *rest, told = self.state
        utilisation = float(self.output("largest_utilisation")[0]) if self._yields else 0.0
        words, told = validity.look(self._pipe, self._limits, rest[0], utilisation, told)
        if words:
            known, self.state = self._memo_of is self.state, (*rest, told)
            self._memo_of = self.state if known else None  # what was computed of the state still holds
        return words

    def step(self, time: float, h: float, inputs: dict[str, Array]) -> str | None:
        """Advance by h [s]; a message, and the state unchanged, if Newton's method does not converge, nor in sub-steps if allowed.

        A top that yields gets no sub-steps: each part would have a velocity of its own, and the work would not be that of the means.
        """
        start, mobility = self.state[0], inputs["mobility"].reshape(6, 6)
        if start.time != time:
            start = start._replace(time=time)
        most = 1 if mobility.any() else self._most
        step = partial(self._pipe.step, mobility=mobility)
        result, parts = substeps.divide(step, start, inputs["velocity"], inputs["angular_velocity"], h, most)
        what = f"step of {h:g} s at t = {time:g} s"
        if not result.converged:
            nor = f", nor in sub-steps of {h / most:g} s" if most > 1 else ""
            if result.flaw:
                return f"{what}{nor}: an element would be {result.flaw}; more nodes may help"
            corrections = f"no convergence after {result.iterations} corrections"
            return f"{what}: {corrections}{nor}, residual {result.residual:.2e} of the largest element force"
        self.state = (result.state, result.top, result.impedance, result.iterations, result.residual, self.state[-1])
        remarks = self._look()
        if len(parts) > 1:
            remarks.append(
                f"{what}: done in {len(parts)} sub-steps of {min(parts):g} s or more, {result.iterations} corrections; pose and "
                "work of the top are exact, but its velocity jumps at both ends of the step instead of being smooth"
            )
        self.remark = "\n".join(remarks)
        return None

    def output(self, name: str) -> Array:
        """Values (size,) of a port, computed when first asked for in a state."""
        if self._memo_of is not self.state:
            self._memo_of, self._memo = self.state, {}
        if name not in self._memo:
            self._compute(name)
        return self._memo[name]

    def _compute(self, name: str) -> None:
        state, top, impedance, iterations, residual, _ = self.state
        memo = self._memo
        if name in ("force", "moment"):
            memo["force"], memo["moment"] = -top[:3], -top[3:]  # eq. (69)
        elif name in ("force_change", "moment_change"):
            memo["force_change"], memo["moment_change"] = -top[:3] - self._reference[:3], -top[3:] - self._reference[3:]
        elif name in ("top_velocity", "top_angular_velocity"):
            memo["top_velocity"], memo["top_angular_velocity"] = state.last[-1, :3], state.last[-1, 3:]
        elif name == "top_position":
            memo[name] = state.position[-1]
        elif name == "top_quaternion":
            memo[name] = state.quaternion[-1]
        elif name == "impedance":
            memo[name] = np.ravel(impedance)
        elif name.endswith("_energy"):
            memo |= {port: np.array([value]) for port, value in zip(ENERGIES, self._pipe.energies(state), strict=True)}
        elif name == "top_work":
            memo[name] = np.array([state.top_work])
        elif name in WORK_PORTS:
            memo |= {port: state.works[i : i + 1] for i, port in enumerate(WORK_PORTS)}
        elif name == "pipe_length":
            memo[name] = np.array([self._pipe.stretched_length(state)])
        elif name == "newton_iterations":
            memo[name] = np.array([float(iterations)])
        elif name == "newton_residual":
            memo[name] = np.array([residual])
        elif name == "s":
            memo[name] = self._pipe.s
        elif name == "node_position":
            memo[name] = state.position.ravel()
        else:
            self._recover(state)

    def _recover(self, state: Any) -> None:
        forces = self._pipe.section_forces(state)
        end = self._pipe.spatial(state, forces, -1)
        self._memo |= {
            "node_tension": forces.tension,
            "node_wall_tension": self._pipe.wall_tension(state, forces),
            "node_moment": forces.moment.ravel(),
            "node_shear": forces.shear.ravel(),
            "largest_tension": np.array([forces.tension.max()]),
            "largest_bending_moment": np.array([self._pipe.largest_bending_moment(forces)]),
            "largest_von_mises": np.array([self._pipe.largest_von_mises(state, forces)]),
            "end_force": -end[:3],
            "end_moment": -end[3:],
        }
        if self._yields:
            self._memo["largest_utilisation"] = np.array([self._pipe.utilisation(state, forces)])


def _has_yield_stress(parameters: PipeParameters) -> bool:
    return any(section.yield_stress is not None for section in parameters.all_sections)


def _optional(parameters: PipeParameters) -> dict[str, bool]:
    return {
        **loads.present(parameters),
        "internal_dissipation": parameters.internal_damping > 0.0,
        "numerical_dissipation": parameters.numerical_damping > 0.0,
    }
