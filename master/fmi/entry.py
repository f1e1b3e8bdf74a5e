"""Entry script of an exported FMU (copied into it under the name of the bundled package + ``_entry``).

An FMU is unpacked into a new folder every time, and numba's on-disk cache goes by file path. So the bundled package,
whose name carries a hash of its content, is put once into a folder of the user's and imported from there:
``$PIPELAY_CACHE``, else ``~/.cache/pipelay``, else a folder of the user's own in the temporary directory. Different
versions never meet, and compiled kernels are found again. The builder keeps its files by the same rule: it imports
this module for it.
"""

import contextlib
import ctypes
import importlib
import importlib.util
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

PACKAGE = __name__.removesuffix("_entry")
IN_FMU = __name__.endswith("_entry")

# PythonFMU runs this text at import and once more for every instance, and each time releases this module's globals once
# too often; without a reference for each of these runs they would vanish under the living classes.
ctypes.pythonapi.Py_IncRef(ctypes.py_object(globals()))


def cache_folders(kind: str) -> Iterator[Path]:
    """Folders for files of a kind, made if need be, that can be written: best place first."""
    for place in _places():
        folder = place / kind
        try:
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
        except OSError:
            continue
        yield folder


def _places() -> Iterator[Path]:
    if chosen := os.environ.get("PIPELAY_CACHE"):
        yield Path(chosen)
    with contextlib.suppress(RuntimeError):  # no home directory
        yield Path.home() / ".cache" / "pipelay"
    with contextlib.suppress(FileNotFoundError):  # no temporary directory
        yield Path(tempfile.gettempdir(), f"pipelay-{getattr(os, 'getuid', lambda: 'user')()}")


def settle(bundled: Path) -> Path:
    """Copy the bundled package to its lasting place in one atomic move, unless it is there; returns that place."""
    for folder in cache_folders("units"):
        place = folder / bundled.name
        if place.is_dir():
            return place
        try:
            with tempfile.TemporaryDirectory(dir=folder) as unfinished:
                copy = shutil.copytree(bundled, Path(unfinished, bundled.name))
                for source in copy.rglob("*.py"):  # older than any kernels that came along, which are then not taken for stale
                    os.utime(source, (0, 0))
                with contextlib.suppress(FileExistsError):  # another process was faster
                    copy.rename(place)
        except OSError:
            pass
        if place.is_dir():
            return place
    return bundled


def load() -> ModuleType:
    """The bundled package's module with the unit and its adapter, imported once in a process."""
    if PACKAGE not in sys.modules:
        place = settle(Path(__file__).parent / PACKAGE)
        finder = importlib.util.spec_from_file_location
        spec = finder(PACKAGE, place / "__init__.py", submodule_search_locations=[str(place)])
        assert spec is not None
        assert spec.loader is not None
        package = importlib.util.module_from_spec(spec)
        sys.modules[PACKAGE] = package
        spec.loader.exec_module(package)
    return importlib.import_module(f"{PACKAGE}.fmi_unit")


if IN_FMU:
    _unit = load()

    class Slave(_unit.UnitSlave):  # type: ignore[name-defined]
        """The slave that PythonFMU instantiates."""

        unit_class = _unit.Unit
