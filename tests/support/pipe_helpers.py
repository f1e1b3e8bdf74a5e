"""What the tests of the pipe share: the pipes of the reference, rotations in plain numpy, and the step's energy balance."""

import math
from dataclasses import replace

import numpy as np

from pipe_fmu import Pipe, PipeParameters, Section
from pipe_fmu.environment import Current, Environment
from pipe_fmu.line import Water
from pipe_fmu.statics import system as static_kernel
from pipe_fmu.step import system as step_kernel
from pipe_fmu.step.state import WORKS

P12 = Section(outer_diameter=0.32385, wall_thickness=0.0206)
P16 = Section()
P30 = Section(outer_diameter=0.761, wall_thickness=0.0355, youngs_modulus=210e9)
_PEER_TUBE = Section(wall_thickness=0.025, drag_normal=1.0, drag_tangential=0.01 * math.pi, rotational_damping=(0.0, 0.0, 0.0))
PEER = replace(_PEER_TUBE, shear_stiffness=0.5 * 207e9 / 2.6 * _PEER_TUBE.steel_area)
SECTIONS = {"P12": P12, "P16": P16, "P30": P30}

HANGING = (0.0, 0.0, 0.0, 0.0)
TANGENT = (804.7189562, 0.0, -800.0)


def pitch(angle):
    """Attitude of a section `angle` [rad] above the horizontal in the x-z plane."""
    return (math.cos(0.5 * angle), 0.0, math.sin(0.5 * angle), 0.0)


TANGENT_ATTITUDE = pitch(math.radians(67.380135))


def sea(depth=800.0, current=None, **options):
    """Environment with a current of `current` [m/s] at the surface across the plane of the line."""
    flow = None if current is None else Current(velocity=(0.0, current, 0.0), **options)
    return Environment(depth=depth, current=flow)


def heave_case(**changes):
    """Case heave of the published comparison: clamped foot, pinned top, cross current, no other physics."""
    return PipeParameters(
        **(
            {
                "section": PEER,
                "top": "pinned",
                "top_position": (800.0, 0.0, -800.0),
                "top_quaternion": HANGING,
                "environment": sea(810.0, 0.8),
            }
            | changes
        )
    )


def rotation(q):
    """Rotation matrix of a unit quaternion."""
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def rotation_vector_quaternion(theta):
    """Quaternion of a rotation vector."""
    theta = np.asarray(theta, dtype=float)
    angle = np.linalg.norm(theta)
    return np.concatenate([[math.cos(0.5 * angle)], 0.5 * np.sinc(0.5 * angle / math.pi) * theta])


def times(p, q):
    """Quaternion product."""
    v = p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])
    return np.concatenate([[p[0] * q[0] - p[1:] @ q[1:]], v])


def balance(pipe, old, new):
    """(energy created in the step, allowance of the identity) [J]."""
    before, after = np.array(pipe.energies(old)), np.array(pipe.energies(new))
    works = dict(zip(WORKS, new.works - old.works, strict=True))
    top = new.top_work - old.top_work
    lost = sum(value for name, value in works.items() if name != "current")
    created = (after - before).sum() - top - works["current"] + lost
    exchanged = np.abs(after - before).sum() + abs(top) + sum(abs(value) for value in works.values())
    return created, 1e-10 * exchanged + 1e-14 * np.abs(after).sum()


def march(pipe, state, motion, h, count):
    """States and results of `count` steps of `h`; motion(t) is the (displacement, angle about e2) of the top."""
    states, results = [state], []
    for _ in range(count):
        t = states[-1].time
        here, there = motion(t), motion(t + h)
        velocity = (np.asarray(there[0]) - np.asarray(here[0])) / h
        spin = np.array([0.0, (there[1] - here[1]) / h, 0.0])
        result = pipe.step(states[-1], velocity, spin, h)
        if not result.converged:
            raise RuntimeError(f"step of {h} s at {t} s: residual {result.residual:.1e}")
        states.append(result.state)
        results.append(result)
    return states, results


def started(parameters, time=0.0):
    """(pipe, equilibrium, state of rest)."""
    pipe = Pipe(parameters)
    found, state = pipe.start(time)
    if not found.converged:
        raise RuntimeError(f"statics: residual {found.residual:.1e}")
    return pipe, found, state


def bar(length, nodes, *, axial, shear, torsion, bending, bending_3=None, mass=1.0, weight=0.0, inertia=1e-12, **changes):
    """Line of one section with given stiffnesses, equal elements, no water and `weight` [N/m] whatever its mass."""
    section = Section(
        outer_diameter=0.1,
        wall_thickness=0.01,
        axial_stiffness=axial,
        shear_stiffness=shear,
        torsional_stiffness=torsion,
        bending_stiffness=bending,
        bending_stiffness_3=bending_3,
        mass=mass,
        displaced_area=0.0,
        drag_normal=0.0,
        drag_tangential=0.0,
        rotational_damping=(0.0, 0.0, 0.0),
        rotational_inertia=(inertia, inertia, inertia),
    )
    where = (0.5 * length, 0.0, -0.3 * length)
    pipe = Pipe(PipeParameters(length=length, nodes=nodes, mesh="uniform", section=section, top_position=where))
    return pipe.s, loaded(pipe.line, weight=np.full(nodes - 1, float(weight)))._replace(**changes)


def loaded(line, **changes):
    """The line with other columns of its loads."""
    return line._replace(loads=line.loads._replace(**changes))


STILL = Water(np.zeros(0), np.zeros((0, 3)), False)


def assembled(diagonal, lower, upper):
    """Dense matrix (6 n, 6 n) of a block tridiagonal one."""
    n = len(diagonal)
    out = np.zeros((n, 6, n, 6))
    for i in range(n):
        out[i, :, i] = diagonal[i]
        if i + 1 < n:
            out[i, :, i + 1], out[i + 1, :, i] = upper[i], lower[i]
    return out.reshape(6 * n, 6 * n)


def static_system(line, position, quaternion, water=STILL):
    """(residual (6 n,), tangent (6 n, 6 n), potentials) of the line at rest, no end held."""
    n = len(position)
    system = np.empty((n, 6, 6)), np.empty((n - 1, 6, 6)), np.empty((n - 1, 6, 6))
    residual, drag = np.empty((n, 6)), np.empty((n, 6))
    potentials = static_kernel.static_system(line, water, position, quaternion, *system, residual, drag)
    return residual.ravel(), assembled(*system), potentials


def turned(position, quaternion, x):
    """Configuration after displacements and spins x (n, 6)."""
    return position + x[:, :3], np.array([times(rotation_vector_quaternion(t), q) for t, q in zip(x[:, 3:], quaternion, strict=True)])


def node_numbers(lines):
    """Numbers of the nodes of lines joined end to end: the last of one is the first of the next, each kept with its own attitude."""
    sizes = [len(line.mass) for line in lines]
    return np.arange(sum(sizes)) - np.repeat(np.arange(len(sizes)), sizes)


def joined(lines, system):
    """(residual, tangent) of lines joined rigidly, at any angle, end to end; `system(line, part)` gives those of the nodes `part`.

    A rigid joint makes displacement and spin of the two ends the same and leaves their attitudes apart: exact for any rotation.
    """
    n = node_numbers(lines)[-1] + 1
    residual, tangent, first = np.zeros(6 * n), np.zeros((6 * n, 6 * n)), 0
    for k, line in enumerate(lines):
        part = slice(first, first + len(line.mass))
        own = slice(6 * (part.start - k), 6 * (part.stop - k))
        r, t = system(line, part)[:2]
        residual[own] += r
        tangent[own, own] += t
        first = part.stop
    return residual, tangent


def members(line):
    """A line as the only member of a list, a list of lines as it is."""
    return line if isinstance(line, list) else [line]


def dense_equilibrium(line, position, quaternion, free, load=0.0, limit=40, turn=0.5):
    """Newton's method on dense matrices: rest under dead nodal forces and moments `load` (6 n,) with only the unknowns `free` moving.

    line: one, or a list of lines joined end to end. turn: largest rotation of a node in one correction [rad].
    """
    lines = members(line)
    node = node_numbers(lines)
    for _ in range(limit):
        residual, tangent = joined(lines, lambda one, part, at=(position, quaternion): static_system(one, *(a[part] for a in at)))
        x = np.zeros(len(residual))
        x[free] = np.linalg.solve(tangent[np.ix_(free, free)], -(residual - load)[free])
        x *= min(1.0, turn / max(np.abs(x.reshape(-1, 6)[:, 3:]).max(), 1e-12))
        position, quaternion = turned(position, quaternion, x.reshape(-1, 6)[node])
        if np.abs(x).max() < 1e-8 * sum(one.length.sum() for one in lines):
            return position, quaternion
    raise RuntimeError("no equilibrium")


def straight(s, direction=(1.0, 0.0, 0.0), attitude=(1.0, 0.0, 0.0, 0.0)):
    """Positions and attitudes of a straight unstretched line."""
    return np.outer(s, direction), np.tile(np.array(attitude), (len(s), 1))


def step_system(line, old, x, h, water=STILL, flow=None):
    """(residual (6 n,), tangent (6 n, 6 n), new strain, works) of a step from `old` = (position, attitude, velocity, rate)."""
    n = len(x)
    position, quaternion, velocity, rate = old
    system = np.empty((n, 6, 6)), np.empty((n - 1, 6, 6)), np.empty((n - 1, 6, 6)), np.empty((n, 6))
    strain, new_strain, works = np.empty((n - 1, 7)), np.empty((n - 1, 7)), np.empty(len(WORKS))
    step_kernel.element_strains(line, position, quaternion, strain)
    flow = np.zeros((len(line.added_mass), 3)) if flow is None else flow
    step_kernel.step_system(line, water, h, position, quaternion, velocity, rate, flow, strain, x, new_strain, True, True, system, works)
    return system[3].ravel(), assembled(*system[:3]), new_strain, works


def moved(line, old, x, h):
    """State after the increments x (n, 6): means of the velocities (of the masses' centres) and body rates are increments / h."""
    position, quaternion, velocity, rate = old
    turn = np.array([rotation(q).T @ t for q, t in zip(quaternion, x[:, 3:], strict=True)])
    new = turned(position, quaternion, x)
    way = centres(line, *new) - centres(line, position, quaternion)
    return *new, 2 * way / h - velocity, 2 * turn / h - rate


def centres(line, position, quaternion):
    """Centres of the nodes' masses: `offset` ahead of the node along t1."""
    return position + line.offset[:, None] * np.array([rotation(q)[:, 0] for q in quaternion])


def free_step(line, old, h, water=STILL, limit=60, load=0.0, held=()):
    """Step of a line whose ends are both free: Newton's method on dense matrices, to round-off.

    line: one, or a list of lines joined end to end. load (6 n,): dead nodal loads, means over the step; held: unknowns at rest.
    """
    lines = members(line)
    node = node_numbers(lines)
    n = node[-1] + 1
    length = sum(one.length.sum() for one in lines)
    free = np.setdiff1d(np.arange(6 * n), held)
    x = np.zeros((n, 6))
    x[node] = np.hstack([h * old[2], np.array([h * rotation(q) @ w for q, w in zip(old[1], old[3], strict=True)])])
    x.reshape(-1)[list(held)] = 0.0
    size = math.inf
    for _ in range(limit):
        wide = x[node]
        residual, tangent = joined(lines, lambda one, part, wide=wide: step_system(one, [a[part] for a in old], wide[part], h, water))
        dx = np.linalg.solve(tangent[np.ix_(free, free)], (load - residual)[free])
        x.reshape(-1)[free] += dx
        before, size = size, np.abs(dx).max()
        if size < 1e-13 * length or (size < 1e-9 * length and size > 0.3 * before):
            parts, wide = np.cumsum([len(one.mass) for one in lines])[:-1], x[node]
            pieces = zip(lines, zip(*(np.split(a, parts) for a in old), strict=True), np.split(wide, parts), strict=True)
            return tuple(np.concatenate(a) for a in zip(*(moved(one, state, way, h) for one, state, way in pieces), strict=True))
    raise RuntimeError(f"free step of {h} s: last correction {size:.1e}")
