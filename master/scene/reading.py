"""Scenes: TOML files that name what is simulated, built-in ones among the package's data.

A scene is read, changed by `--set key=value`, and checked as far as the master's own sections go; the tables of the
units stay plain mappings, which the process that prepares a run hands to the units' own dataclasses.
"""

from __future__ import annotations

import difflib
import json
import math
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

from master.errors import UsageError
from master.fmi.schema import build
from master.scene.sections import Coupling, Simulation, Start, Tables, TopMotion
from master.scene.two_fmus import General, general

BUILT_IN = resources.files("master") / "scenes"
UNIT_TABLES = ("environment", "pipe", "vessel")
FOUND = {
    "pipe.top_position": "follows from [start]",
    "pipe.top_quaternion": "follows from [start]",
    "pipe.reference_force": "is found by the statics",
    "pipe.reference_moment": "is found by the statics",
    "pipe.nodes_at": "follows from nodes, tolerance and mesh",
    "pipe.environment": "is the table [environment]",
    "vessel.environment": "is the table [environment]",
    "vessel.start": "follows from [start]",
    "vessel.hold_force": "is found by the statics",
    "vessel.departure_angle": "is found by the statics, or start.departure",
    "vessel.departure_rotation": "is found by the statics",
}
"""Parameters of the units that a scene may not give, and where they come from."""
DEEPEST = 20  # tables and lists within one another
LEAST, LARGEST = 1e-30, 1e30  # amount of a number of pipe and vessel, beyond any in SI units: the products of a few are finite


DEFAULTS = {"pipe.internal_damping": 0.005}
"""What a scene has where it does not say otherwise, while a unit by itself has none: a damping ratio of pi x 0.005 s / T at a period T.

That is 0.5 % of critical, which DNV-RP-F105 (6.2) gives for steel, at 3 s, 0.17 % at 9 s, and 2 % of the first axial mode of 1000 m.
"""


class SceneError(UsageError):
    """A scene that cannot be used; one line that names key, value and rule."""


@dataclass(frozen=True)
class Sections:
    """The tables of a scene; those of the units are checked by the units."""

    start: Start
    environment: dict
    pipe: dict
    simulation: Simulation | None = None
    title: str = ""
    description: str = ""
    coupling: Coupling = field(default_factory=Coupling)
    vessel: dict | None = field(default=None, metadata={"doc": "a vessel that holds the top; without it the pipe is alone, its top held"})
    top_motion: TopMotion | None = field(default=None, metadata={"doc": "moves the top of a pipe alone"})
    tables: Tables | None = field(default=None, metadata={"doc": "loads on the hull over time"})

    def __post_init__(self) -> None:
        if self.start.departure is not None and self.pipe.get("top") == "pinned":
            departure = f"start.departure = {self.start.departure:g}"
            raise ValueError(f"{departure}: must be absent with pipe.top = 'pinned', which holds no attitude")
        if self.vessel is None:
            self._check_pipe_alone()
        elif self.top_motion is not None:
            raise ValueError("top_motion: must be absent where [vessel] moves the top")
        elif self.start.z is not None:
            raise ValueError(
                f"start.z = {self.start.z:g}: must be absent with [vessel], which floats at its own height"
            )

    def _check_pipe_alone(self) -> None:
        if self.start.z is None:
            raise ValueError("start.z: must be given without [vessel], for the height at which the pipe's top is held")
        if self.start.yaw and self.start.departure is None:
            raise ValueError(f"start.yaw = {self.start.yaw:g}: must be absent without [vessel] or start.departure: it turns nothing")
        for name in ("tables", "start.release"):
            owner, _, key = name.rpartition(".")
            if getattr(getattr(self, owner) if owner else self, key) is not None:
                raise ValueError(f"{name}: must be absent without [vessel], on which it acts")
        for key in ("scheme", "tolerance", "rollback"):
            if (value := getattr(self.coupling, key)) != (usual := getattr(Coupling(), key)):
                given, allowed = json.dumps(value), json.dumps(usual)
                raise ValueError(f"coupling.{key} = {given}: must be {allowed} or absent without [vessel]: there is nothing to couple")


@dataclass(frozen=True)
class Scene:
    """A scene by name, its checked sections, and the plain mapping that it came from."""

    name: str
    sections: Any  # Sections of pipe and vessel, or General of any two FMUs
    mapping: dict[str, Any]


def built_in() -> dict[str, str]:
    """Names of the built-in scenes and their titles."""
    files = sorted((f for f in BUILT_IN.iterdir() if f.name.endswith(".toml")), key=lambda f: f.name)
    return {f.name.removesuffix(".toml"): str(_parse(f.name, f.read_bytes()).get("title", "")) for f in files}


def load(name: str, changes: Iterable[str] = ()) -> Scene:
    """The scene of a built-in name or of a TOML file, with `changes` ("key=value") made to it.

    Raises SceneError.
    """
    path = Path(name)
    mapping = _parse(name, _read(name, path))
    for change in changes:
        _merge(mapping, _parse_change(change), change)
    return from_mapping(mapping, path.stem, path.parent)


def from_mapping(mapping: dict[str, Any], name: str, folder: Path = Path()) -> Scene:
    """The scene of a nested mapping as TOML gives it; [units] makes it one of any two FMUs, sought in `folder`. Raises SceneError."""
    if "units" in mapping:
        try:
            return Scene(name, general(mapping, folder), mapping)
        except ValueError as error:
            raise SceneError(str(error)) from None
    for key in UNIT_TABLES:
        if not isinstance(mapping.get(key, {}), dict):
            raise SceneError(f"{key} = {mapping[key]!r}: must be a table")
    for key, origin in FOUND.items():
        table, _, leaf = key.partition(".")
        if leaf in mapping.get(table, {}):
            raise SceneError(f"{key}: {origin}; must be absent")
    for key, value in _leaves(mapping):
        if isinstance(value, float) and math.isfinite(value) and value and not LEAST <= abs(value) <= LARGEST:
            raise SceneError(f"{key} = {value:g}: must be 0, or in amount from {LEAST:g} to {LARGEST:g}")
    try:
        return Scene(name, build(Sections, mapping), mapping)
    except ValueError as error:
        raise SceneError(str(error)) from None


def _read(name: str, path: Path) -> bytes:
    if path.name == name and not path.suffix:
        names = list(built_in())
        if name in names:
            return (BUILT_IN / f"{name}.toml").read_bytes()
        near = difflib.get_close_matches(name, names, 1, 0.5)
        hint = f" (did you mean {near[0]}?)" if near else ""
        raise SceneError(
            f"scene = {name!r}: unknown built-in scene{hint}; there are {', '.join(names)}, or give a .toml file"
        )
    if path.suffix != ".toml":
        raise SceneError(f"scene = {name!r}: a scene file must end in .toml")
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise SceneError(f"scene = {name!r}: no such file") from None
    except (OSError, ValueError) as error:  # the latter for a null character
        raise SceneError(f"scene = {name!r}: cannot be read ({getattr(error, 'strerror', error)})") from None


def _parse(name: str, content: bytes) -> dict[str, Any]:
    try:
        return _sound(tomllib.loads(content.decode("utf-8")))
    except UnicodeDecodeError as error:
        raise SceneError(f"scene = {name!r}: must be UTF-8 text ({error.reason} at byte {error.start})") from None
    except SceneError:
        raise
    except (ValueError, RecursionError) as error:  # a number of thousands of digits, thousands of brackets
        raise SceneError(f"scene = {name!r}: not TOML: {str(error).partition(';')[0]}") from None


def _sound(mapping: dict[str, Any]) -> dict[str, Any]:
    """`mapping`, if every value in it can be looked at, printed and handed on. Raises SceneError."""
    for path, value in _leaves(mapping):
        if isinstance(value, int) and value.bit_length() > 64:
            raise SceneError(f"{path} has {value.bit_length()} bits: must be finite, an integer within 64 bits")
    return mapping


def _leaves(mapping: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Every value that is no table and no list, with its place. Raises SceneError where tables and lists lie too deep."""
    level = list(mapping.items())
    for _ in range(DEEPEST):
        inner: list[tuple[str, Any]] = []
        for path, value in level:
            if isinstance(value, dict):
                inner += [(f"{path}.{key}", item) for key, item in value.items()]
            elif isinstance(value, list):
                inner += [(f"{path}[{i}]", item) for i, item in enumerate(value, 1)]
            else:
                yield path, value
        level = inner
    if level:
        raise SceneError(f"{level[0][0][:60]}...: must not nest more than {DEEPEST} tables and lists")


def _parse_change(change: str) -> dict[str, Any]:
    key, equals, value = (part.strip() for part in change.partition("="))
    if not (key and equals and value):
        raise SceneError(f"--set {change}: must be key=value, as in simulation.duration=60")
    try:
        return _sound(tomllib.loads(f"{key} = {value}"))
    except SceneError:
        raise
    except (ValueError, RecursionError):
        rule = (
            'the value must be a number, true, false, [a, list] or a "text" in quotes (quote the whole for the shell)'
        )
        shown = change if len(change) <= 80 else change[:77] + "..."
        raise SceneError(f"--set {shown}: {rule}") from None


def _merge(mapping: dict[str, Any], change: Mapping[str, Any], source: str, path: str = "") -> None:
    """Put the leaves of `change` into `mapping`, in place."""
    for key, value in change.items():
        where = f"{path}.{key}" if path else key
        if not isinstance(value, dict) or not value or key not in mapping:
            mapping[key] = value
        elif isinstance(mapping[key], dict):
            _merge(mapping[key], value, source, where)
        else:
            raise SceneError(f"--set {source}: {where} = {mapping[key]!r} is no table that could hold a key")


def simulated(sections: Sections) -> Simulation:
    """The table [simulation] of a scene that is to be run. Raises SceneError where it has none."""
    if sections.simulation is None:
        raise SceneError("simulation: must be given, with duration and macro_step, to run or export a scene")
    return sections.simulation


def of_pipe(scene: Scene) -> Scene:
    """The scene, if it has a pipe. Raises SceneError."""
    if isinstance(scene.sections, General):
        raise SceneError(f"scene = {scene.name!r}: is of FMUs given as files; this command needs one with [pipe]")
    return scene
