"""Random lines at rest; run as a program: ``python tests/support/random_lines.py COUNT [FIRST]``.

Steel pipes, cables, hoses, buoyant and nearly neutral lines and lines with buoyancy modules; stretched, taut and slack, nearly vertical
and not, of any azimuth and heading, over a bed or none, in a current or none. Line number k is always the same. The program solves the
lines FIRST, FIRST + 1, ..., each on 48 nodes and on a mesh four times finer; it prints every line that is not found, not stable, inverted
or wrong, and those that take long, then the count.
"""

import math
import sys
import time
from dataclasses import dataclass, replace

import numpy as np
from pipe_helpers import HANGING, rotation, rotation_vector_quaternion, times
from statics_grid import HOSE

from pipe_fmu import Pipe, PipeParameters, Seabed, Section
from pipe_fmu.environment import Current, Environment
from pipe_fmu.statics.balance import Scales
from pipe_fmu.statics.solve import Equilibrium, equilibrium

KINDS = ("steel", "cable", "hose", "buoyant", "neutral", "modules")
FORCE, MOMENT = 0.02, 0.05  # errors allowed on 48 nodes, of the top's force and of the largest bending moment
FINER = 4
FEW = 50  # steps of descent on the finer mesh, near the line's own shape
SLOW = 5.0  # s of one line on 48 nodes


@dataclass(frozen=True)
class Drawn:
    """A line; `turn` (3,) is the rotation vector, in e, of its top section away from how it hangs, None if it is left so."""

    name: str
    parameters: PipeParameters
    turn: tuple[float, float, float] | None


@dataclass(frozen=True)
class Judged:
    """What became of a line: `cosine`, least between chord and sections; `errors` of top force and largest moment, relative."""

    name: str
    found: bool
    stable: bool
    cosine: float
    errors: tuple[float, float]
    seconds: float
    unresolved: bool = False  # judged on more nodes, for the usual ones do not resolve its bending or find nothing

    @property
    def faults(self) -> list[str]:
        """What is wrong with it."""
        if not self.found:
            return ["not found"]
        out = [] if self.stable else ["not stable"]
        out += ["inverted"] if self.cosine <= 0.0 else []
        wrong = not (self.errors[0] <= FORCE and self.errors[1] <= MOMENT)
        return out + ([f"wrong by {self.errors[0]:.1%} of its force, {self.errors[1]:.1%} of its moment"] if wrong else [])


def draw(number: int) -> Drawn:
    """Line `number`."""
    random = np.random.default_rng([20, number])
    kind = KINDS[number % len(KINDS)]
    depth = float(np.exp(random.uniform(math.log(50.0), math.log(2500.0))))
    height = depth * float(random.uniform(0.6, 0.98))
    across = float(random.choice([random.uniform(0.0, 0.02), random.uniform(0.1, 1.0), random.uniform(1.0, 2.0)]))
    span = height * math.hypot(1.0, across)
    length = span * float(random.choice([random.uniform(0.9998, 1.0005), random.uniform(1.001, 1.05), random.uniform(1.05, 2.5)]))
    azimuth = float(random.uniform(-math.pi, math.pi))
    top = (height * across * math.cos(azimuth), height * across * math.sin(azimuth), -height)
    flow, heading = float(random.uniform(0.1, 1.2)), float(random.uniform(-math.pi, math.pi))
    current = Current(velocity=(flow * math.cos(heading), flow * math.sin(heading), 0.0), profile=str(random.choice(["linear", "uniform"])))
    current = current if random.random() < 0.5 else None
    bed = Seabed(reference_weight=500.0) if random.random() < 0.5 else None
    foot = str(random.choice(["clamped", "pinned"]))
    turned = tuple(float(x) for x in random.uniform(-0.5, 0.5, 3)) if kind != "cable" and random.random() < 0.4 else None
    section = _section(kind, random)
    parameters = PipeParameters(
        length=length,
        section=section,
        sections=_modules(section, length, random) if kind == "modules" else (),
        foot=foot,
        top="pinned" if turned is None else "clamped",
        top_position=top,
        top_quaternion=HANGING,
        seabed=bed,
        environment=Environment(depth=depth, current=current),
    )
    name = f"{number}: {kind}, length {length:.5g} m, span {span:.5g} m, height {height:.4g} m, foot {foot}"
    name += f"{', bed' if bed else ''}{f', current {flow:.2g} m/s {current.profile}' if current else ''}{', turned' if turned else ''}"
    return Drawn(name, parameters, turned)


def _section(kind: str, random: np.random.Generator) -> Section:
    diameter = float(random.uniform(0.15, 0.8))
    tube = Section(outer_diameter=diameter, wall_thickness=diameter * float(random.uniform(0.045, 0.09)))
    displaced = 1025.0 * tube.outer_area
    if kind == "cable":
        return replace(tube, bending_stiffness=tube.stiffness[3] * 10.0 ** float(random.uniform(-6.0, -3.0)), mass=2.0 * displaced)
    if kind == "hose":
        return replace(HOSE, bending_stiffness=1e5 * 10.0 ** float(random.uniform(-3.0, 0.5)))
    if kind == "buoyant":
        return replace(tube, mass=displaced * float(random.uniform(0.4, 0.95)))
    if kind == "neutral":
        return replace(tube, mass=displaced * (1.0 + float(random.choice([-1.0, 1.0])) * 10.0 ** float(random.uniform(-8.0, -2.0))))
    return replace(tube, mass=displaced * float(random.uniform(1.2, 3.0)))


def _modules(section: Section, length: float, random: np.random.Generator) -> tuple[Section, ...]:
    first, part = float(random.uniform(0.1, 0.5)), float(random.uniform(0.1, 0.3))
    light = replace(section, mass=1025.0 * section.outer_area * float(random.uniform(0.5, 0.95)))
    return tuple(replace(one, length=share * length) for one, share in ((section, first), (light, part), (section, 1.0 - first - part)))


def cosine(found: Equilibrium) -> float:
    """Least cosine, over the elements, of the angle between the chord and t1 half way between the ends: negative if inside out."""
    least = 1.0
    for i, chord in enumerate(np.diff(found.position, axis=0)):
        a, b = found.quaternion[i : i + 2]
        middle = a + (b if a @ b >= 0.0 else -b)
        least = min(least, float(rotation(middle / np.linalg.norm(middle))[:, 0] @ chord) / float(np.linalg.norm(chord)))
    return least


def solve(drawn: Drawn, nodes: int) -> tuple[Pipe, Equilibrium]:
    """The line on so many nodes, its top as it hangs or turned from there."""
    pipe = Pipe(replace(drawn.parameters, nodes=nodes))
    top = pipe.parameters.top_position
    found = pipe.equilibrium(top, None)
    if drawn.turn is not None and found.converged:
        held = times(rotation_vector_quaternion(drawn.turn), found.quaternion[-1])
        pipe = Pipe(replace(drawn.parameters, nodes=nodes, top_quaternion=tuple(float(x) for x in held)))
        found = pipe.equilibrium(top, held)
    return pipe, found


def judge(drawn: Drawn, nodes: int = 48) -> Judged:
    """Solve a line, and judge it by a mesh four times finer, started from its own shape, or where that ends elsewhere by itself."""
    start = time.process_time()
    pipe, found = solve(drawn, nodes)
    seconds = time.process_time() - start
    if not found.converged:
        return Judged(drawn.name, False, False, math.nan, (math.nan, math.nan), seconds)
    fine = Pipe(replace(pipe.parameters, nodes=FINER * (nodes - 1) + 1, nodes_at=()))
    best = equilibrium(fine.line, fine.water(0.0), Scales(fine.line), refined(pipe, found, fine), FEW)
    errors = compare(pipe, found, fine, best)
    if not (errors[0] <= FORCE and errors[1] <= MOMENT):
        errors = compare(pipe, found, *solve(drawn, len(fine.s)))
    return Judged(drawn.name, True, found.stable, cosine(found), errors, seconds)


def settled(drawn: Drawn) -> Judged:
    """The verdict on 48 nodes, or on four times as many where 48 do not resolve how the line bends, as a hose within a metre, or where it
    is said of them that they find nothing, as of a cable that turns back at its clamped foot.
    """
    judged = judge(drawn)
    unresolved = not judged.found or not (judged.errors[0] <= FORCE and judged.errors[1] <= MOMENT)
    return replace(judge(drawn, FINER * 47 + 1), unresolved=True) if unresolved else judged


def compare(pipe: Pipe, found: Equilibrium, fine: Pipe, best: Equilibrium) -> tuple[float, float]:
    """Errors of the top's force and the largest bending moment, relative to the larger of the weight and the finer mesh's own force,
    and of its largest moment (or of that which turns a clamped end by a twentieth, sqrt(EI T) / 20, where there is hardly any).
    """
    if not best.converged:
        return math.inf, math.inf
    weight = float(np.abs(fine.line.loads.weight) @ fine.line.length)
    force = max(float(np.linalg.norm(best.top[:3])), 0.1 * weight)
    moments = [p.largest_bending_moment(p.section_forces(p.at_rest(f))) for p, f in ((pipe, found), (fine, best))]
    bending = math.sqrt(float(fine.line.stiffness[:, 4].max()) * force)
    error = float(np.linalg.norm(found.top[:3] - best.top[:3])) / force
    return error, abs(moments[0] - moments[1]) / max(moments[1], 0.05 * bending)


def refined(pipe: Pipe, found: Equilibrium, fine: Pipe) -> tuple[np.ndarray, np.ndarray]:
    """The line's shape at the nodes of another mesh: cubic between its nodes, the attitudes turned evenly."""
    s, h = pipe.s, np.diff(pipe.s)
    at = np.clip(np.searchsorted(s, fine.s, side="right") - 1, 0, len(h) - 1)
    x = ((fine.s - s[at]) / h[at])[:, None]
    tangent = np.array([rotation(q)[:, 0] for q in found.quaternion])
    a, b = found.position[at], found.position[at + 1]
    slopes = h[at][:, None] * tangent[at], h[at][:, None] * tangent[at + 1]
    position = a + x * x * (3.0 - 2.0 * x) * (b - a) + x * (1.0 - x) * ((1.0 - x) * slopes[0] - x * slopes[1])
    p, q = found.quaternion[at], found.quaternion[at + 1]
    q = np.where(np.sum(p * q, axis=1, keepdims=True) < 0.0, -q, q)
    mixed = (1.0 - x) * p + x * q
    return position, mixed / np.linalg.norm(mixed, axis=1, keepdims=True)


def main(count: int, first: int = 0) -> int:
    """Judge lines and print what is wrong with them; the number of those at fault."""
    solve(draw(first), 12)  # compiles
    faulty, unresolved, spent = 0, 0, []
    for number in range(first, first + count):
        judged = settled(draw(number))
        faulty += bool(judged.faults)
        unresolved += judged.unresolved
        spent.append(judged.seconds)
        remarks = judged.faults + ([f"took {judged.seconds:.1f} s"] if judged.seconds > SLOW else [])
        if remarks:
            sys.stdout.write(f"{judged.name}: {'; '.join(remarks)}\n")
            sys.stdout.flush()
    sound = f"{count} lines: {count - faulty} found, stable, not inverted and right, {faulty} not"
    sound += f" ({unresolved} of them judged on {FINER * 47 + 1} nodes, for 48 do not resolve their bending or find nothing)"
    sys.stdout.write(f"{sound}; {np.median(spent):.2f} s each (median), {max(spent):.1f} s at most\n")
    return faulty


if __name__ == "__main__":
    sys.exit(1 if main(*map(int, sys.argv[1:])) else 0)
