"""The pipe: parameters in, statics and steps out."""

import numpy as np

from . import model, validity
from .arrays import Array
from .constants import walls
from .line import Water, water_at
from .maths.so3 import matrix
from .notes import SIZE, texts
from .parameters import PipeParameters
from .results import section_forces, wall_stress
from .results.section_forces import SectionForces
from .statics.solve import Equilibrium, solve
from .step import integrator
from .step.integrator import STIFF, PipeState, StepResult
from .vectors import Unit, unpacked


class Pipe:
    """A discretised pipe in its water. Holds no state: states are values handed in and out.

    s (n,): arc lengths of the nodes [m]; line: element data. Raises ValueError for parameters that cannot be discretised.
    """

    def __init__(self, parameters: PipeParameters) -> None:
        self.parameters = model.resolve(parameters)
        self.constants = model.constants(self.parameters)
        self.unit: Unit = unpacked(self.constants)
        self.s, self.line, self.sea, self.mass = self.unit.s, self.unit.line, self.unit.sea, self.unit.mass
        self.element_walls = self.unit.element_walls
        self.walls = walls(self.parameters, self.s)

    def water(self, time: float) -> Water:
        """The water at `time` [s]."""
        water: Water = water_at(self.sea, time)
        return water

    def equilibrium(self, top: tuple[float, float, float], attitude: Array | None, time: float = 0.0) -> Equilibrium:
        """Static equilibrium with the top at `top` (3,) [m], e, its section at `attitude` (4,), or as it hangs if None."""
        return solve(self.line, self.s, self.water(time), top, attitude)

    def start(self, time: float) -> tuple[Equilibrium, PipeState]:
        """Equilibrium at the parameters' own top pose, and the state of rest in it."""
        attitude = np.array(self.parameters.top_quaternion)
        found = self.equilibrium(self.parameters.top_position, attitude if attitude.any() else None, time)
        return found, self.at_rest(found, time)

    def straight(self) -> PipeState:
        """State of rest of the unstretched line along x: no equilibrium, but of the layout of all states."""
        position, quaternion = np.zeros((len(self.s), 3)), np.zeros((len(self.s), 4))
        position[:, 0], quaternion[:, 0] = self.s, 1.0
        return self._resting(position, quaternion, 0.0)

    def at_rest(self, found: Equilibrium, time: float = 0.0) -> PipeState:
        """State of rest in an equilibrium."""
        return self._resting(found.position, found.quaternion, time)

    def _resting(self, position: Array, quaternion: Array, time: float) -> PipeState:
        state: PipeState = integrator.rest(self.line, position, quaternion, float(time))
        return state

    def step(self, state: PipeState, velocity: Array, spin: Array, h: float, mobility: Array = STIFF) -> StepResult:
        """Step of h [s] with the top's mean velocity and angular velocity (3,), e, or those without the pipe of a top that yields to
        its pull with `mobility` (6, 6); the water is that of mid-step.
        """
        return integrator.step(self.line, self.water(state.time + 0.5 * h), state, velocity, spin, h, mobility)

    def energies(self, state: PipeState) -> tuple[float, ...]:
        """Energies [J], in the order of state.ENERGIES."""
        energies: tuple[float, ...] = integrator.energy_of(self.line, state)
        return energies

    def section_forces(self, state: PipeState) -> SectionForces:
        """Section forces at the nodes, material components, without those of numerical damping."""
        water, motion = self.water(state.time), (state.velocity, state.rate)
        wrenches = section_forces.nodal_wrenches(self.line, self.mass, water, state.position, state.quaternion, *motion, state.strain)
        return SectionForces.of(wrenches)

    def spatial(self, state: PipeState, forces: SectionForces, node: int) -> Array:
        """Force and moment (6,), e, in the section at a node, on the line below it: at the top those that hold it."""
        r = np.array(matrix(tuple(state.quaternion[node])))
        return np.concatenate([r @ np.append(forces.tension[node], forces.shear[node]), r @ forces.moment[node]])

    def von_mises(self, state: PipeState, forces: SectionForces) -> Array:
        """Largest von Mises stress (n,) [Pa] over the wall at every node."""
        return wall_stress.von_mises(self.walls, state.position, forces)

    def largest_von_mises(self, state: PipeState, forces: SectionForces) -> float:
        """Largest von Mises stress [Pa] along the line, between the nodes too."""
        return wall_stress.largest_von_mises(self.element_walls, self.s, state.position, forces)[0]

    def utilisation(self, state: PipeState, forces: SectionForces) -> float:
        """Largest von Mises stress over the yield stress along the line, between the nodes too; 0 where no section has a yield stress."""
        return wall_stress.largest_von_mises(self.element_walls, self.s, state.position, forces)[1]

    def wall_tension(self, state: PipeState, forces: SectionForces) -> Array:
        """Force (n,) [N] in the wall at every node, at a joint in that of the section below."""
        return wall_stress.wall_tension(self.walls[0], state.position, forces)

    def largest_bending_moment(self, forces: SectionForces) -> float:
        """Largest bending moment [N m] along the line, between the nodes too."""
        return section_forces.largest_bending_moment(self.s, forces)

    def stretched_length(self, state: PipeState) -> float:
        """Length of the centreline [m], the paper's s_h of Fig. 4."""
        return float(section_forces.centreline_length(self.line.length, state.strain))

    def remarks(self, state: PipeState, utilisation: float) -> list[str]:
        """One line on each kind that is beyond its limit in a state."""
        notes = np.zeros(SIZE)
        stiffness, quiet = self.line.stiffness, validity.QUIET.copy()
        validity.look(self.s, stiffness, self.unit.limits, state.position, state.strain, utilisation, quiet, 0, notes)
        return texts(notes, validity.WORDS)
