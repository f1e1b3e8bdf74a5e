"""Two hundred lines at rest: three steel pipes, a cable and a hose, from nearly vertical to nearly taut, in 50 to 3000 m of water.

A full factorial of line, depth, distance and bed; length over depth, current, foot and departure run through their values beside it.
"""

import math
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


def equilibrium(scene: Scene):
    """(pipe, hanging equilibrium, equilibrium with the top section turned)."""
    pipe = Pipe(scene.parameters)
    hung = pipe.equilibrium(scene.parameters.top_position, None)
    held = times(rotation_vector_quaternion(scene.turn), hung.quaternion[-1])
    return pipe, hung, pipe.equilibrium(scene.parameters.top_position, np.array(held))
