"""Two hundred lines at rest: three steel pipes, a cable and a hose, from nearly vertical to nearly taut, in 50 to 3000 m of water.

A full factorial of line, depth, distance and bed; length over depth, current, foot and departure run through their values beside it.

`python tests/support/statics_grid.py [COARSE FINE [NUMBER ...]]` compares all of them, or those numbered, on two meshes (48 and 200 nodes):
top force and largest bending moment, hanging and turned.
"""

import math
import sys
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from pipe_helpers import HANGING, P12, P16, P30, rotation_vector_quaternion, times

from pipe_fmu import Pipe, PipeParameters, Seabed, Section
from pipe_fmu.environment import Current, Environment

HOSE = Section(  # flexible jumper of Low and Langley (2006)
    outer_diameter=0.396,
    wall_thickness=None,
    mass=165.0,
    axial_stiffness=5e8,
    shear_stiffness=1e8,
    torsional_stiffness=1e5,
    bending_stiffness=120.8e3,
    drag_normal=1.0,
)
LINES = {"12 in": P12, "16 in": P16, "30 in": P30, "cable": replace(P16, bending_stiffness=P16.stiffness[3] / 1e4), "hose": HOSE}
DEPTHS = (50.0, 300.0, 1000.0, 3000.0)
DISTANCES = (0.02, 0.3, 0.6, 0.9, 0.995)  # of the taut
SLACK = (1.05, 1.5, 2.5)  # length over depth
CURRENTS = (None, Current(velocity=(0.0, 1.0, 0.0)), Current(velocity=(-0.4, 0.3, 0.0), profile="uniform"), None)
TURNS = ((0.0, 0.0), (30.0, 0.0), (-30.0, 0.0), (60.0, 0.0), (-60.0, 0.0), (0.0, 60.0), (30.0, -30.0))  # deg: pitch, yaw


@dataclass(frozen=True)
class Scene:
    """One line; `turn` (3,) is the rotation vector, in e, of its top section away from how it hangs."""

    name: str
    parameters: PipeParameters
    turn: tuple[float, float, float]


def scenes() -> list[Scene]:
    """The grid, always in the same order."""
    out = []
    for i, (line, depth, share, bed) in enumerate(product(LINES, DEPTHS, DISTANCES, (False, True))):
        slack, current = SLACK[i % 3], CURRENTS[(i + i // 40) % 4]
        pitch, yaw = (math.radians(a) for a in TURNS[i % 7])
        length = slack * depth
        parameters = PipeParameters(
            length=length,
            section=LINES[line],
            foot="pinned" if i % 5 == 4 else "clamped",
            top_position=(share * math.sqrt(length**2 - depth**2), 0.0, -depth),
            top_quaternion=HANGING,
            seabed=Seabed() if bed else None,
            environment=Environment(depth=depth, current=current),
        )
        name = f"{i}: {line}, {depth:g} m, {slack:g} x depth, {share:g} of taut, turned {TURNS[i % 7]}"
        name += f"{', bed' if bed else ''}{', current' if current else ''}, foot {parameters.foot}"
        out.append(Scene(name, parameters, (0.0, pitch, yaw)))
    return out


def equilibrium(scene: Scene, nodes: int = 48):
    """(pipe, hanging equilibrium, equilibrium with the top section turned)."""
    pipe = Pipe(replace(scene.parameters, nodes=nodes))
    hung = pipe.equilibrium(scene.parameters.top_position, None)
    held = times(rotation_vector_quaternion(scene.turn), hung.quaternion[-1])
    return pipe, hung, pipe.equilibrium(scene.parameters.top_position, np.array(held))


def figures(pipe, found):
    """(size of the force at the top, largest bending moment) of an equilibrium; NaN if it is none or not stable."""
    if not (found.converged and found.stable):
        return math.nan, math.nan
    return float(np.linalg.norm(found.top[:3])), pipe.largest_bending_moment(pipe.section_forces(pipe.at_rest(found)))


def differences(coarse, fine):
    """Relative differences of two `figures`, over those of the `fine` mesh."""
    return [abs(a - b) / b for a, b in zip(coarse, fine, strict=True)]


def main(coarse: int = 48, fine: int = 200, *numbers: int) -> None:
    """Print the differences between two meshes, line by line and the largest of all."""
    every, all_scenes = [], scenes()
    for number in numbers or range(len(all_scenes)):
        (pipe, *two), (finer, *same) = (equilibrium(all_scenes[number], nodes) for nodes in (coarse, fine))
        pairs = [differences(figures(pipe, a), figures(finer, b)) for a, b in zip(two, same, strict=True)]
        every.append(np.ravel(pairs))
        print(*(f"{value:8.1e}" for value in every[-1]), all_scenes[number].name, flush=True)
    print(*(f"{value:8.1e}" for value in np.max(every, axis=0)), "largest; hanging force, moment; turned force, moment")


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
