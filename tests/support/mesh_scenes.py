"""Random lines, seeded: at rest with a tolerance, and with a moving top."""

import math
from dataclasses import dataclass, replace

import numpy as np

from pipe_fmu import PipeParameters, Seabed, Section
from pipe_fmu.environment import Current, Environment
from pipe_fmu.statics import catenary

TOLERANCES = (1e-2, 3e-3, 1e-3, 3e-4)


def random_line(random):
    """A steel pipe from taut to slack in 60 to 2000 m of water, its top clamped up to 0.4 rad off the catenary, or pinned."""
    depth = float(np.exp(random.uniform(*np.log([60.0, 2000.0]))))
    height = depth - min(10.0, 0.1 * depth)
    length = height * random.uniform(1.1, 2.0)
    diameter = random.uniform(0.15, 0.8)
    wall = diameter * random.uniform(0.055, 0.09)
    bed = Seabed() if random.random() < 0.4 else None
    taut, slackest = math.sqrt(length**2 - height**2), length - height if bed else 0.0  # a line that is pushed over a bed rests anywhere
    distance = slackest + random.uniform(0.3, 0.97) * (taut - slackest)
    speed = random.choice([0.0, random.uniform(0.2, 1.0)])
    heading = random.uniform(-math.pi, math.pi)
    flow = Current(velocity=(speed * math.cos(heading), speed * math.sin(heading), 0.0)) if speed else None
    _, quaternions = catenary.shape(np.array([0.0, length]), length, (distance, 0.0, -height), bed is not None)
    hanging = 2.0 * math.atan2(quaternions[-1, 2], quaternions[-1, 0])
    top, foot = random.choice(["clamped", "pinned"], p=[0.75, 0.25]), random.choice(["clamped", "pinned"], p=[0.75, 0.25])
    widest = 0.5 if foot == "clamped" else 3.0
    azimuth = random.choice([0.0, random.uniform(-widest, widest)])
    pitch = hanging + random.uniform(-0.4, 0.4)
    cp, sp, ca, sa = math.cos(0.5 * pitch), math.sin(0.5 * pitch), math.cos(0.5 * azimuth), math.sin(0.5 * azimuth)
    held = random.random() < 0.8 and top == "clamped"
    return PipeParameters(
        length=length,
        section=Section(outer_diameter=diameter, wall_thickness=wall),
        foot=str(foot),
        top=str(top),
        top_position=(distance * math.cos(azimuth), distance * math.sin(azimuth), -height),
        top_quaternion=(ca * cp, -sa * sp, ca * sp, sa * cp) if held else (0.0, 0.0, 0.0, 0.0),
        seabed=bed,
        environment=Environment(depth=depth, current=flow),
    )


def resting(count, seed=40):
    """`count` random lines with a tolerance."""
    random = np.random.default_rng(seed)
    return [replace(random_line(random), tolerance=float(random.choice(TOLERANCES))) for _ in range(count)]


@dataclass(frozen=True)
class Moving:
    """A line whose top swings about its start by `amplitude` (3,) [m] with `period` [s], faded in over two periods."""

    name: str
    parameters: PipeParameters
    amplitude: tuple[float, float, float]
    period: float

    def motion(self, time):
        """(displacement, turn) of the top."""
        fade = 0.5 * (1.0 - math.cos(math.pi * min(time / (2.0 * self.period), 1.0)))
        return fade * math.sin(2.0 * math.pi * time / self.period) * np.array(self.amplitude), 0.0


def moving(count, seed=8):
    """`count` random lines with a moving top; none comes nearer to taut than nine tenths of its slack."""
    random, out = np.random.default_rng(seed), []
    while len(out) < count:
        parameters = random_line(random)
        size, direction, period = random.uniform(0.5, 4.0), random.normal(size=3) * [0.6, 0.4, 1.0], random.uniform(6.0, 14.0)
        amplitude = size * direction / np.linalg.norm(direction)
        farthest = max(np.linalg.norm(np.array(parameters.top_position) + sign * amplitude) for sign in (-1.0, 1.0))
        slack = parameters.length - np.linalg.norm(parameters.top_position)
        if farthest < parameters.length - 0.1 * slack:
            out.append(Moving(f"random {len(out)}", parameters, tuple(amplitude.tolist()), period))
    return out
