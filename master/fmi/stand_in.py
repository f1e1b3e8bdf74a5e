"""Lets the units' packages be, in this process, those that the FMUs carry: kernels are then compiled once for both, and ahead.

A process that compiles kernels binds them otherwise than one that loads them, with other round-off: compiled ahead, the first run is
equal to the later ones to the last bit.
"""

from __future__ import annotations

import importlib
import importlib.util
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType
from typing import Any

from .build import Recipe, bundled_package, cache_folder, cached_fmu, compile_kernels


class _Alias(MetaPathFinder, Loader):
    """Finds modules by other names, as the objects that they are."""

    def __init__(self, packages: Mapping[str, str]) -> None:
        self._packages = packages
        self._specs: dict[str, ModuleSpec | None] = {}

    def find_spec(self, fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None) -> ModuleSpec | None:
        """A spec for `fullname` if its package is one of ours."""
        return ModuleSpec(fullname, self) if fullname.partition(".")[0] in self._packages else None

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """The module itself."""
        package, dot, rest = spec.name.partition(".")
        module = importlib.import_module(self._packages[package] + dot + rest)
        self._specs[spec.name] = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        """It is there already; it gets back the spec that importing it by another name took from it."""
        assert module.__spec__ is not None
        module.__spec__ = self._specs.pop(module.__spec__.name)


def let_stand_in(units: Mapping[str, tuple[str, Mapping[str, Any]]]) -> tuple[dict[str, Path], Callable[[], None]]:
    """For `units`, none of them imported yet: package -> place of the unit's class in it (``slave.PipeUnit``) and parameters with which an
    FMU is built without running a kernel.

    Returns the packages' own folders, and a function to be called before any kernel is run, which has those that are not compiled
    compiled by processes of their own. Both raise RunError.
    """
    folders = {}
    for package in units:
        spec = importlib.util.find_spec(package)
        assert spec is not None
        assert spec.origin is not None
        folders[package] = Path(spec.origin).parent
    recipes = [Recipe(folders[package], unit, parameters) for package, (unit, parameters) in units.items()]
    fmus = [cached_fmu(recipe, cache_folder("fmus")) for recipe in recipes]
    names = {package: bundled_package(fmu).__name__ for package, fmu in zip(units, fmus, strict=True)}
    sys.meta_path.insert(0, _Alias(names))

    def compile_all() -> None:
        with ThreadPoolExecutor() as pool:
            list(pool.map(compile_kernels, recipes, fmus))

    return folders, compile_all
