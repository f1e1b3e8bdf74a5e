"""Libraries made ahead, each by a process of its own: units are compiled side by side, and the process that asked only loads their kernels.

A process that compiles kernels binds them otherwise than one that loads them, with other round-off: made ahead, the equilibrium of the
first run is equal to that of later ones to the last bit.
"""

from __future__ import annotations

import functools
import gc
import importlib.util
import json
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from ...errors import RunError
from .. import schema
from ..build import Recipe
from ..cache import cache_folder
from .export import machine_of
from .machine import ARM, PLATFORMS, Platform, kept, library


def made_ahead(
    units: Mapping[str, tuple[str, Mapping[str, Any]]], platforms: Sequence[Platform]
) -> tuple[dict[str, Path], Callable[[], None]]:
    """For `units`, package -> place of the unit's class in it (``slave.PipeUnit``) and parameters: the packages' folders, and a function
    that has the libraries made which are not kept. Raises RunError where one cannot be.
    """
    folders = {}
    for package in units:
        spec = importlib.util.find_spec(package)
        assert spec is not None
        assert spec.origin is not None
        folders[package] = Path(spec.origin).parent
    recipes = [Recipe(folders[package], unit, parameters) for package, (unit, parameters) in units.items()]

    def make(recipe: Recipe) -> None:
        if not all(kept(platform, recipe.name, recipe.bundle, cache_folder("libraries")).is_file() for platform in platforms):
            request = json.dumps([str(recipe.package), recipe.unit, recipe.parameters, [platform.triple for platform in platforms]])
            done = subprocess.run([sys.executable, "-P", "-m", __name__, request], capture_output=True, text=True)
            if done.returncode:
                raise RunError(f"the FMU's kernels cannot be compiled: {done.stderr.strip().rpartition(chr(10))[2]}")

    def make_all() -> None:
        with ThreadPoolExecutor() as pool:
            list(pool.map(make, recipes))

    return folders, make_all


def main(request: str) -> None:
    """Compile one unit's kernels and keep its libraries for the platforms asked for."""
    package, unit_name, parameters, wanted = json.loads(request)
    gc.disable()  # the compiler makes much, and little of it is ever free
    recipe = Recipe(Path(package), unit_name, parameters)
    unit = recipe.unit_class(schema.build(recipe.unit_class.PARAMETERS, parameters))
    unit.initialize(0.0, {})  # compiles what Python calls
    machine = functools.cache(lambda: machine_of(unit))
    for platform in (*PLATFORMS, ARM):
        if platform.triple in wanted:
            library(machine, platform, recipe.name, recipe.bundle, cache_folder("libraries"))


if __name__ == "__main__":
    main(sys.argv[1])
