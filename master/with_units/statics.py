"""Coupled static equilibrium of a scene: where the vessel floats and how the pipe hangs before the first step.

The hang-off point is held in x, y and the vessel's heading; heave, roll and pitch settle under restoring, weight of the pipe and current.
The thrust that holds x, y and heading follows (the paper's G_stat = 0 has no such equilibrium without it). Works with the units' own
packages, so never in a process that runs FMUs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import root
from scipy.spatial.transform import Rotation

from master.errors import RunError, UsageError
from master.fmi.schema import build
from master.scene.reading import DEFAULTS, Scene
from pipe_fmu import Pipe, PipeParameters, resolve, validity
from pipe_fmu.environment import Environment
from pipe_fmu.statics.solve import Equilibrium
from vessel_fmu.dp_controller import set_point
from vessel_fmu.parameters import Start, VesselParameters, values
from vessel_fmu.vessel import Vessel

T = TypeVar("T")
P = TypeVar("P", PipeParameters, VesselParameters)
_UNBALANCE = 1e-9  # of the pipe's pull (times lever and a metre for moments) left to the vessel, beside the pipe's own residual
_DIFFERENCE = 1e-10  # square of the relative step of differences: far above what the pipe's answer is known to
_NOISE = 1e-12  # of a vector's norm: components below it are round-off


@dataclass(frozen=True)
class Prepared:
    """Parameters of the units at equilibrium (released from it where the scene says so), and the pipe's equilibrium."""

    pipe: PipeParameters
    vessel: VesselParameters | None
    found: Equilibrium


def equilibrium(scene: Scene) -> Prepared:
    """Equilibrium of a scene, without its release. Raises UsageError for parameters the units refuse, RunError where none is found."""
    start = scene.sections.start
    pipe, vessel = parameters(scene)
    held = None if start.departure is None else Rotation.from_euler("ZY", [start.yaw, start.departure])
    try:
        if vessel is None:
            pipe = _resolved(pipe, np.array(pipe.top_position), held)
            found = _hang(Pipe(pipe), np.array(pipe.top_position), held)
            return Prepared(_placed(pipe, found), None, found)
        even_keel = np.array([start.x, start.y, vessel.hang_off[2] - vessel.environment.depth])
        return _floating(scene, _resolved(pipe, even_keel, held), vessel)
    except RunError as error:  # for which a wrong unit is a reason
        raise RunError("; ".join([str(error), *validity.of_parameters(pipe)])) from None


def parameters(scene: Scene) -> tuple[PipeParameters, VesselParameters | None]:
    """Parameters of the units before anything is computed. Raises UsageError for what the units refuse."""
    start, environment = scene.sections.start, scene.mapping["environment"]
    depth = _checked(Environment, environment, "environment").depth
    pipe = _pipe(scene, (start.x, start.y, -depth if start.z is None else start.z))
    if scene.sections.vessel is None:
        return pipe, None
    return pipe, _checked(VesselParameters, scene.mapping["vessel"] | {"environment": environment}, "vessel")


def released(scene: Scene, at: Prepared) -> Prepared:
    """`at`, with the vessel moved by the scene's release and the pipe hanging statically from where that brings its top."""
    release = scene.sections.start.release
    if release is None or at.vessel is None:
        return at
    start = at.vessel.start
    x, y, z = start.position
    roll, pitch, yaw = start.attitude
    moved = replace(start, position=(x, y, z + release.heave), attitude=(roll + release.roll, pitch + release.pitch, yaw))
    vessel = replace(at.vessel, start=moved)
    state = Vessel(vessel).start()
    body = Vessel(vessel)
    point, held = body.hang_off_pose(body.position(state), state.quaternion)
    found = _hang(Pipe(at.pipe), point, _rotation(held))
    return Prepared(_posed(at.pipe, point, held), vessel, found)


def _floating(scene: Scene, pipe_parameters: PipeParameters, parameters: VesselParameters) -> Prepared:
    """Heave, roll and pitch at which the vessel carries the pipe; then the thrust that holds the rest."""
    start, pipe = scene.sections.start, Pipe(pipe_parameters)
    depth = parameters.environment.depth
    pull = float(np.linalg.norm(_hang(pipe, np.array(pipe_parameters.top_position), None).top[:3]))
    lever = 1.0 + math.hypot(*parameters.hang_off)

    def settle(unknown: np.ndarray) -> tuple[VesselParameters, Equilibrium, np.ndarray, np.ndarray, np.ndarray]:
        z, roll, pitch = unknown
        attitude = Rotation.from_euler("ZYX", [start.yaw, pitch, roll])
        centre = np.array([start.x, start.y, z - depth]) - attitude.apply(parameters.hang_off) * [1.0, 1.0, 0.0]
        posed = replace(parameters, start=Start(position=_three(centre), attitude=(roll, pitch, start.yaw)), hold_force=(0.0, 0.0, 0.0))
        if start.departure is not None:
            posed = replace(posed, departure_angle=start.departure)
        body = Vessel(posed)
        state = body.start()
        point, held = body.hang_off_pose(body.position(state), state.quaternion)
        found = _hang(pipe, point, _rotation(held) if start.departure is not None else None)
        force, moment = body.static_load(body.position(state), state.quaternion, body.surface_current(0.0))
        centred = body.moment_about_centre(state.quaternion, -found.top[:3], -found.top[3:])
        return posed, found, force - found.top[:3], moment + centred, point

    def unbalance(force: np.ndarray, moment: np.ndarray) -> np.ndarray:
        along = Rotation.from_euler("z", -start.yaw).apply(moment)
        return np.array([force[2], along[0] / lever, along[1] / lever]) / pull

    options = {"xtol": 1e-14, "eps": _DIFFERENCE}
    solution = root(lambda unknown: unbalance(*settle(unknown)[2:4]), np.zeros(3), method="hybr", options=options)
    posed, found, force, moment, point = settle(solution.x)
    left = float(np.abs(unbalance(force, moment)).max())
    if not left < _UNBALANCE + found.residual:
        raise RunError(f"statics: the vessel finds no equilibrium in heave, roll and pitch (unbalance {left:.1e} of the pull)")
    if start.departure is None:
        state = Vessel(posed).start()
        relative = _rotation(state.quaternion).inv() * _rotation(found.quaternion[-1])
        first = relative.apply([1.0, 0.0, 0.0])
        angle = float(np.arctan2(-first[2], first[0]))
        rest = relative * Rotation.from_euler("y", -angle)
        posed = replace(posed, departure_angle=angle, departure_rotation=_three(rest.as_rotvec()))
    if posed.controller is not None:
        x, y, yaw = set_point(values(posed)).tolist()
        posed = replace(posed, controller=replace(posed.controller, x=x, y=y, yaw=yaw))
    hold = without_noise((-force[0], -force[1], -moment[2]))
    posed = _replaced("vessel", posed, hold_force=_three(hold))
    body = Vessel(posed)
    _, held = body.hang_off_pose(np.array(posed.start.position), body.start().quaternion)
    return Prepared(_posed(pipe_parameters, point, held), posed, found)


def _hang(pipe: Pipe, point: np.ndarray, attitude: Rotation | None) -> Equilibrium:
    """The pipe's equilibrium with its top at `point`. Raises RunError if there is none."""
    held = None if attitude is None else np.roll(attitude.as_quat(), 1)
    found = pipe.equilibrium(_three(point), held, 0.0)
    if not found.converged:
        raise RunError(
            f"statics: the pipe finds no equilibrium with its top at {tuple(np.round(point, 3).tolist())} m: "
            f"{found.unbalance(pipe.s)}"
        )
    return found


def _pipe(scene: Scene, top: tuple[float, float, float]) -> PipeParameters:
    """The scene's pipe hanging from `top` [m]; each of its `sections` has what it does not say itself from `section`, and its mesh suits
    the amplitude of [top_motion] where it gives none itself.
    """
    mapping, (x, y, z), motion = scene.mapping["pipe"], top, scene.sections.top_motion
    usual = {key.removeprefix("pipe."): value for key, value in DEFAULTS.items()}
    if motion is not None:
        usual["top_amplitude"] = math.hypot(*motion.amplitude)
    mapping = usual | mapping
    common, sections = mapping.get("section", {}), mapping.get("sections")
    if isinstance(common, dict) and isinstance(sections, list):
        mapping = mapping | {"sections": [common | entry if isinstance(entry, dict) else entry for entry in sections]}
    above = {"top_position": [0.0, 0.0, z], "top_quaternion": [0.0] * 4, "environment": scene.mapping["environment"]}
    pipe = _checked(PipeParameters, mapping | above, "pipe")  # over the foot first: a pipe that is too short even there is named
    if (distance := math.hypot(*top)) > pipe.longest:
        name, value = ("start.x", x) if abs(x) >= abs(y) else ("start.y", y)
        most = f"at most {pipe.longest:.6g} m, to which pipe.length = {pipe.length:g} m can be stretched"
        rule = f"must keep the distance from foot to top, {distance:.6g} m, {most}"
        raise UsageError(f"{name} = {value:g}: {rule}")
    return _replaced("pipe", pipe, top_position=top)


def _checked(kind: type[T], mapping: dict[str, Any], path: str) -> T:
    try:
        return build(kind, mapping, path)
    except ValueError as error:
        raise UsageError(str(error).replace(f"{path}.environment.", "environment.")) from None


def _replaced(unit: str, parameters: P, **changes: Any) -> P:
    """The parameters of a unit with some replaced. Raises UsageError."""
    try:
        return replace(parameters, **changes)
    except ValueError as error:
        raise UsageError(f"{unit}.{error}") from None


def _resolved(pipe: PipeParameters, point: np.ndarray, attitude: Rotation | None) -> PipeParameters:
    """The pipe with its nodes placed for its top at `point`, its section at `attitude`, or as it hangs if None."""
    quaternion = np.zeros(4) if attitude is None else np.roll(attitude.as_quat(), 1)
    try:
        return resolve(_posed(pipe, point, quaternion))
    except ValueError as error:
        raise UsageError(f"pipe.{error}") from None


def _placed(pipe: PipeParameters, found: Equilibrium) -> PipeParameters:
    return _posed(pipe, found.position[-1], found.quaternion[-1])


def _posed(pipe: PipeParameters, point: np.ndarray, quaternion: np.ndarray) -> PipeParameters:
    w, x, y, z = (float(q) for q in quaternion)
    return _replaced("pipe", pipe, top_position=_three(point), top_quaternion=(w, x, y, z))


def _rotation(quaternion: np.ndarray) -> Rotation:
    return Rotation.from_quat(np.roll(np.asarray(quaternion), -1))


def without_noise(vector: ArrayLike) -> np.ndarray:
    """`vector` with what is round-off against its norm set to 0."""
    values = np.array(vector, dtype=float)
    values[np.abs(values) <= _NOISE * np.linalg.norm(values)] = 0.0
    return values


def _three(vector: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in vector)
    return x, y, z
