"""Contestant: MoorDyn's lumped-mass line with bending stiffness (no torsion, no shear), Runge-Kutta 4.

MoorDyn's axes are x forward, y to port, z up from the surface. Its own search for the start leaves the current out, so the line then rests
for SETTLING seconds in the current before the clock starts. The foot is held by a fixed rod, which clamps the line along x.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from master.studies.benchmarks.histories import SAMPLE, Histories, LineCase, Setting, instants
from pipe_fmu import PipeParameters

SETTLING = 300.0  # s
_COUPLING = 0.025  # s over which the motion of the top is a straight line
_TURN = np.array([1.0, -1.0, -1.0])  # from z down to z up

_FILE = """MoorDyn input
pipe
---------------------- LINE TYPES ----------------------
TypeName Diam Mass/m EA BA/-zeta EI Cd Ca CdAx CaAx
(name) (m) (kg/m) (N) (N-s/-) (N-m^2) (-) (-) (-) (-)
pipe {diameter!r} {mass!r} {axial!r} 0 {bending!r} {normal!r} 0 {tangential!r} 0
---------------------- ROD TYPES ----------------------
TypeName Diam Mass/m Cd Ca CdEnd CaEnd
(name) (m) (kg/m) (-) (-) (-) (-)
clamp 0.4 100 0 0 0 0
---------------------- RODS ----------------------
ID RodType Attachment Xa Ya Za Xb Yb Zb NumSegs RodOutputs
(#) (name) (#/key) (m) (m) (m) (m) (m) (m) (-) (-)
1 clamp Fixed -10 0 {foot!r} 0 0 {foot!r} 1 -
---------------------- POINTS ----------------------
ID Attachment X Y Z Mass Volume CdA Ca
(#) (word) (m) (m) (m) (kg) (m^3) (m^2) (-)
1 Coupled {top[0]!r} {top[1]!r} {top[2]!r} 0 0 0 0
---------------------- LINES ----------------------
ID LineType AttachA AttachB UnstrLen NumSegs LineOutputs
(#) (name) (#) (#) (m) (-) (-)
1 pipe R1B 1 {length!r} {elements} -
---------------------- OPTIONS ----------------------
0 writeLog
{step!r} dtM
RK4 tScheme
{gravity!r} g
{density!r} rho
{below!r} WtrDpth
0 WaveKin
1 Currents
1 disableOutput
0.1 dtIC
500 TmaxIC
1e-6 threshIC
---------------------- need this line ----------------------
"""


def run(parameters: PipeParameters, case: LineCase, setting: Setting) -> tuple[float, Histories]:
    """CPU time [s] of the steps and the histories (no bending moments). Raises ImportError where MoorDyn is not installed."""
    import moordyn

    depth = parameters.environment.depth
    rest = _TURN * parameters.top_position - [0.0, 0.0, depth]
    quarters = [k * setting.elements // 4 for k in (1, 2, 3)]
    positions, forces = [], []
    with tempfile.TemporaryDirectory() as folder, _quiet():
        system = moordyn.Create(str(_write(Path(folder), parameters, setting, rest)))
        moordyn.Init(system, rest.tolist(), [0.0] * 3)
        for k in range(round(SETTLING / _COUPLING)):
            moordyn.Step(system, rest.tolist(), [0.0] * 3, k * _COUPLING, _COUPLING)
        line, spent = moordyn.GetLine(system, 1), 0.0
        for t in np.append(0.0, instants(case.duration)):
            begin = time.process_time()
            for k in range(round(SAMPLE / _COUPLING)):
                here, there = (rest + _TURN * case.motion(t + (k + j) * _COUPLING)[0] for j in (0, 1))
                velocity = (there - here) / _COUPLING
                force = moordyn.Step(system, here.tolist(), velocity.tolist(), SETTLING + t + k * _COUPLING, _COUPLING)
            spent += time.process_time() - begin
            positions.append([moordyn.GetLineNodePos(line, j) for j in quarters])
            forces.append(force)
        moordyn.Close(system)
    count = len(instants(case.duration))
    places = _TURN * (np.array(positions) + np.array([0.0, 0.0, depth]))
    return spent, Histories(places[:count], -np.array(forces)[:count] * _TURN, np.full(count, np.nan))


def _write(folder: Path, parameters: PipeParameters, setting: Setting, top: np.ndarray) -> Path:
    """The input files; the bed lies far below, where it cannot touch."""
    section, environment = parameters.section, parameters.environment
    assert environment.current is not None
    axial, _, _, bending, _ = section.stiffness
    depth, (x, y, _) = environment.depth, environment.current.velocity
    rows = [f"{z!r} {x * (1.0 + z / depth)!r} {-y * (1.0 + z / depth)!r} 0" for z in np.linspace(-depth, 0.0, 82).tolist()]
    (folder / "current_profile.txt").write_text("\n".join(["MoorDyn current", "steady", "z (m), ux (m/s), uy (m/s), uz (m/s)", *rows, ""]))
    path = folder / "lines.txt"
    path.write_text(
        _FILE.format(
            diameter=section.outer_diameter, mass=section.mass_per_length, axial=axial, bending=bending, normal=section.drag_normal,
            tangential=section.drag_tangential / np.pi, foot=-depth, top=top.tolist(), length=parameters.length, elements=setting.elements,
            step=setting.step_s, gravity=environment.gravity, density=environment.water_density, below=2.0 * depth,
        )
    )  # fmt: skip
    return path


@contextmanager
def _quiet() -> Iterator[None]:
    """MoorDyn writes its banner to the process's streams before anything can be set."""
    kept = os.dup(1), os.dup(2)
    try:
        with open(os.devnull, "w", encoding="utf-8") as nowhere:
            os.dup2(nowhere.fileno(), 1)
            os.dup2(nowhere.fileno(), 2)
            yield
    finally:
        for saved, stream in zip(kept, (1, 2), strict=True):
            os.dup2(saved, stream)
            os.close(saved)
