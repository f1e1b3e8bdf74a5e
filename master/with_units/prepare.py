"""The process that prepares a run: checks the scene's units, finds the equilibrium, writes the FMUs.

Reads the scene as JSON from standard input; `--export DIR` writes pipe.fmu and vessel.fmu there, for all platforms, else they go to a cache
by content, for this one; with `--python` they are run by Python instead of being machine code. Prints JSON: fmus; or error, exit.
"""

from __future__ import annotations

import json
import os
import select
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

from master.errors import RunError, UsageError, broken_arithmetic
from master.fmi.build import Recipe, build_fmu, cached_fmu
from master.fmi.cache import cache_folder
from master.fmi.native.ahead import made_ahead
from master.fmi.native.export import native_fmu
from master.fmi.native.machine import PLATFORMS, own_platform
from master.fmi.runtime import end_with_reader
from master.fmi.schema import to_mapping
from master.fmi.stand_in import let_stand_in
from master.scene.reading import from_mapping

PACKAGES: dict[str, tuple[str, dict[str, Any]]] = {
    "pipe_fmu": ("slave.PipeUnit", {"mesh": "uniform"}),  # an adapted one takes statics
    "vessel_fmu": ("slave.VesselUnit", {}),
}
_BOND = {  # unit of measure -> the vessel's ports of what pipe and vessel exchange
    "N": ("force", "force_change"), "N.m": ("moment", "moment_change"),
    "m/s": ("velocity", "end_velocity"), "rad/s": ("angular_velocity", "end_angular_velocity"),
}  # fmt: skip


def prepare(mapping: dict[str, Any], folder: Path | None, by_python: bool = False) -> dict[str, Any]:
    """FMU files of a scene, which start in its equilibrium. Raises UsageError, RunError."""
    scene = from_mapping(mapping, "scene")
    platforms = (own_platform(),) if folder is None else PLATFORMS
    folders, compile_kernels = let_stand_in(PACKAGES) if by_python else made_ahead(PACKAGES, platforms)
    from master.with_units import statics  # of the packages that now stand in
    from pipe_fmu.slave import PipeUnit

    with broken_arithmetic("parameters"):
        statics.parameters(scene)  # refused before the kernels take their minute
    compile_kernels()
    with broken_arithmetic("statics"):
        at = statics.released(scene, statics.equilibrium(scene))
    simulation = scene.sections.simulation
    experiment = {"start_time": 0.0, "stop_time": simulation.duration, "step_size": simulation.macro_step}
    pull = (0.0 - at.found.top).tolist()  # no -0.0 among them
    pipe = replace(at.pipe, reference_force=tuple(pull[:3]), reference_moment=tuple(pull[3:]))
    units: dict[str, Any] = {"pipe": pipe} | ({} if at.vessel is None else {"vessel": at.vessel})
    nominal = PipeUnit.nominal(pipe)
    shared = {"vessel": {port: nominal[unit] for unit, ports in _BOND.items() for port in ports}}
    held = {"vessel": {"force": pull[:3], "moment": pull[3:]}}
    recipes = {
        name: Recipe(
            folders[f"{name}_fmu"],
            PACKAGES[f"{name}_fmu"][0],
            to_mapping(parameters),
            experiment=experiment,
            inputs=held.get(name, {}),
            nominal=shared.get(name, {}),
        )
        for name, parameters in units.items()
    }
    if by_python:
        fmus = {
            name: cached_fmu(recipe, cache_folder("fmus")) if folder is None else build_fmu(recipe, folder / f"{name}.fmu")
            for name, recipe in recipes.items()
        }
    else:
        fmus = {
            name: native_fmu(recipe, platforms, None if folder is None else folder / f"{name}.fmu")
            for name, recipe in recipes.items()
        }
    return {"fmus": {name: str(path) for name, path in fmus.items()}}


def main(arguments: list[str]) -> None:
    """Entry point."""
    if hasattr(select, "poll"):  # not on Windows, where the process comes to its end first
        end_with_reader(sys.stdout.fileno())
    folder = Path(arguments[1]) if arguments[:1] == ["--export"] else None
    try:
        answer = prepare(json.load(sys.stdin), folder, "--python" in arguments)
    except (UsageError, RunError) as error:
        answer = {"error": str(error), "exit": 2 if isinstance(error, UsageError) else 1}
    except OSError as error:  # a full disk
        answer = {"error": f"the scene cannot be prepared: {error}", "exit": 1}
    except KeyboardInterrupt:  # which Windows tells all processes of a console
        return
    try:
        json.dump(answer, sys.stdout)
        sys.stdout.flush()
    except BrokenPipeError:  # whoever asked went away
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    main(sys.argv[1:])
