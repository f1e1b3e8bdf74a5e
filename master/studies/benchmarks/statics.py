"""Statics of the paper's scene, the pipe alone: CPU time against error, for elements and kinds of mesh, and scipy's `solve_bvp`.

Errors are shares: of the tension at the top, of the largest bending moment, and of the moments at both clamps, against a finer solution of
ours; its uncertainty is its distance from `solve_bvp` to a tolerance of 1e-8, an independent method (collocation) on equations written
here a second time: r' = R (t1 + strain), theta' = kappa, n' = -w e3, M' = -(stretched tangent) x n, in the plane, lengths over the pipe's.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.integrate import solve_bvp

from master.errors import RunError
from master.scene import reading
from master.with_units.statics import equilibrium
from pipe_fmu import Pipe, PipeParameters

UNIFORM, ADAPTED, COLLOCATION = "uniform mesh", "adapted mesh", "solve_bvp"
COUNTS, TOLERANCES = (16, 24, 32, 48, 96, 192, 384), (1e-3, 1e-4, 1e-5, 1e-6)
REFERENCE, REFERENCE_TOLERANCE = 768, 1e-8
KEYS = ("top_tension", "largest_bending", "foot_moment", "top_moment")
_START = 401  # points of the first guess of solve_bvp


@dataclass(frozen=True)
class Setting:
    """Method, elements (0: its own) and tolerance (0: none)."""

    contestant: str
    elements: int = 0
    tolerance: float = 0.0


SETTINGS = (
    *(Setting(kind, n) for kind in (ADAPTED, UNIFORM) for n in COUNTS),
    *(Setting(COLLOCATION, tolerance=tolerance) for tolerance in TOLERANCES),
)


def paper() -> PipeParameters:
    """The pipe of the paper's scene, its top held where the scene's equilibrium has it, the nodes not yet placed."""
    return replace(equilibrium(reading.load("paper")).pipe, nodes_at=())


def run(parameters: PipeParameters, setting: Setting) -> tuple[float, float, np.ndarray]:
    """CPU time [s] of placing the nodes and of the solution; tension at the top [N], largest bending, foot and top moment [N m].

    Raises RunError where there is no solution.
    """
    if setting.contestant == COLLOCATION:
        return (0.0, *_collocated(parameters, setting.tolerance))
    begin = time.process_time()
    pipe = Pipe(replace(parameters, nodes=setting.elements + 1, mesh="uniform" if setting.contestant == UNIFORM else "adapted"))
    placed = time.process_time()
    found, state = pipe.start(0.0)
    solved = time.process_time()
    if not found.converged:
        raise RunError(f"statics with {setting.elements} elements: residual {found.residual:.1e}")
    forces = pipe.section_forces(state)
    values = [forces.tension[-1], pipe.largest_bending_moment(forces), *(np.hypot(*forces.moment[end, 1:]) for end in (0, -1))]
    return placed - begin, solved - placed, np.array(values)


def _collocated(parameters: PipeParameters, tolerance: float) -> tuple[float, np.ndarray]:
    """The same by `solve_bvp` in the plane, from the catenary tangent to the bed at the foot. Raises RunError."""
    section, environment, length = parameters.section, parameters.environment, parameters.length
    axial, shear, _, bending, _ = section.stiffness
    weight = (section.mass_per_length - environment.water_density * section.outer_area) * environment.gravity * length
    x, _, z = parameters.top_position
    w, _, q, _ = parameters.top_quaternion
    held = 2.0 * np.arctan2(q, w)  # pitch up

    def rates(s: np.ndarray, y: np.ndarray) -> np.ndarray:
        """y: x and height over the length, pitch up, force forward and up over the weight, bending moment times length over EI."""
        pitch, pull, lift, moment = y[2:]
        c, e = np.cos(pitch), np.sin(pitch)
        along, across = 1.0 + weight / axial * (pull * c + lift * e), weight / shear * (lift * c - pull * e)
        forward, upward = along * c - across * e, along * e + across * c
        turn = (pull * upward - lift * forward) * weight * length**2 / bending
        return np.array([forward, upward, moment, np.zeros_like(s), np.ones_like(s), turn])

    def ends(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.array([a[0], a[1], a[2], b[0] - x / length, b[1] + z / length, b[2] - held])

    s, c = np.linspace(0.0, 1.0, _START), (length**2 - z**2) / (-2.0 * z * length)
    pitch = np.arctan(s / c)
    start = np.array([c * np.arcsinh(s / c), np.hypot(s, c) - c, pitch, np.full_like(s, c), s, np.gradient(pitch, s)])
    begin = time.process_time()
    found = solve_bvp(rates, ends, s, start, tol=tolerance, max_nodes=100_000)
    spent = time.process_time() - begin
    if not found.success:
        raise RunError(f"solve_bvp to {tolerance:g}: {found.message}")
    y = found.sol(np.linspace(0.0, 1.0, 20_001))
    tension = weight * (y[3, -1] * np.cos(y[2, -1]) + y[4, -1] * np.sin(y[2, -1]))
    moment = bending / length * np.abs(y[5])
    return spent, np.array([tension, moment.max(), moment[0], moment[-1]])


def sweep(repeats: int, tick: Callable[[], object]) -> tuple[list[dict[str, Any]], float]:
    """A row for every setting, CPU times the medians of interleaved repeats; and the uncertainty of the reference. Raises RunError."""
    parameters = paper()
    for setting in (Setting(ADAPTED, 16), Setting(COLLOCATION, tolerance=1e-3)):  # loads and compiles
        run(parameters, setting)
    exact = run(parameters, Setting(ADAPTED, REFERENCE))[2]
    other = run(parameters, Setting(COLLOCATION, tolerance=REFERENCE_TOLERANCE))[2]
    scale = np.array([exact[0], exact[1], exact[1], exact[1]])
    spent: dict[Setting, list[tuple[float, float]]] = {setting: [] for setting in SETTINGS}
    errors: dict[Setting, np.ndarray] = {}
    for _ in range(repeats):
        for setting in SETTINGS:
            placing, solving, values = run(parameters, setting)
            spent[setting].append((placing, solving))
            errors[setting] = np.abs(values - exact) / scale
            tick()
    rows = [
        {"contestant": s.contestant, "elements": s.elements, "tolerance": s.tolerance}
        | dict(zip(("mesh_s", "solve_s"), map(statistics.median, zip(*spent[s], strict=True)), strict=True))
        | {"cpu_s": statistics.median(sum(one) for one in spent[s])}
        | dict(zip(KEYS, errors[s].tolist(), strict=True))
        | {"largest_share": float(errors[s].max())}
        for s in SETTINGS
    ]
    return rows, float((np.abs(other - exact) / scale).max())
