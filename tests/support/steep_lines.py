"""Slack lines whose top stands almost above the foot: steel pipes, cables and hoses that hang down from either end to a narrow bend.

`python tests/support/steep_lines.py [COUNT SEED]` compares random ones on 48 and on 192 nodes (126 of them).
"""

import math
import sys
from dataclasses import replace

import numpy as np
from pipe_helpers import HANGING
from statics_grid import LINES, differences, figures

from pipe_fmu import Pipe, PipeParameters
from pipe_fmu.element.strains import frame
from pipe_fmu.environment import Environment


def lines(count, seed):
    """Parameters of random lines, no bed: 50 to 3000 m, 1.03 to 2.5 times as long as high, the top aside of the foot by 1e-6 to 0.02."""
    random = np.random.default_rng(seed)
    out = []
    for _ in range(count):
        height = math.exp(random.uniform(math.log(50.0), math.log(3000.0)))
        aside, heading = height * 10.0 ** random.uniform(-6.0, math.log10(0.02)), random.uniform(-math.pi, math.pi)
        out.append(
            PipeParameters(
                length=height * random.uniform(1.03, 2.5),
                section=LINES[random.choice(list(LINES))],
                foot=str(random.choice(["pinned", "clamped"])),
                top="pinned",
                top_position=(aside * math.cos(heading), aside * math.sin(heading), -height),
                top_quaternion=HANGING,
                environment=Environment(depth=1.02 * height),
            )
        )
    return out


def least_advance(found):
    """Least part of an element's chord along its own sections, over the chord: not above 0 where it is turned inside out."""
    chords = np.diff(found.position, axis=0)
    ends = zip(found.quaternion, found.quaternion[1:], chords, strict=False)
    return min(frame(tuple(a), tuple(b), tuple(d))[1][0] / np.linalg.norm(d) for a, b, d in ends)


def equilibrium(parameters, nodes):
    """(pipe, equilibrium) on a mesh."""
    pipe = Pipe(replace(parameters, nodes=nodes))
    return pipe, pipe.equilibrium(parameters.top_position, None)


def main(count: int = 126, seed: int = 1) -> None:
    """Print the differences between the two meshes, line by line."""
    for number, parameters in enumerate(lines(count, seed)):
        coarse, fine = (equilibrium(parameters, nodes) for nodes in (48, 192))
        force, moment = differences(figures(*coarse), figures(*fine))
        name = next(name for name, section in LINES.items() if section is parameters.section)
        x, y, z = parameters.top_position
        where = f"{name}, {parameters.foot}, {parameters.length:.0f} m, {-z:.0f} m high, {math.hypot(x, y):.1e} m aside"
        states = [f"{found.top[2]:.5g} N {'stable' if found.stable else 'NOT'} {least_advance(found):.2f}" for _, found in (coarse, fine)]
        print(f"{number:3d} {force:8.1e} {moment:8.1e} {where}: {'; '.join(states)}", flush=True)


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
