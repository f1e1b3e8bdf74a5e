"""Entry script of an exported FMU (copied into it under the name of the bundled package + ``_entry``).

An FMU is unpacked into a new folder every time, and numba's on-disk cache goes by file path. So the bundled package,
whose name carries a hash of its content, is put once into a folder of the user's and imported from there:
``$PIPELAY_CACHE``, else ``~/.cache/pipelay``, else a folder of the user's own in the temporary directory; never one that
others may write to. Different versions never meet, and compiled kernels are found again. The builder keeps its files by
the same rule: it imports this module for it.
"""

import contextlib
import importlib
import importlib.util
import os
import shutil
import stat
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

PACKAGE = __name__.removesuffix("_entry")
IN_FMU = __name__.endswith("_entry")
COMPILED = "compiled_{}"  # empty file in a settled package whose kernels are all there, by what they were compiled with


def cache_folders(kind: str) -> Iterator[Path]:
    """Folders for files of a kind, made if need be, that can be written, and by nobody else: best place first."""
    for place in _places():
        folder = place / kind
        try:
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if not _is_private(folder.stat()):
                continue
            tempfile.TemporaryFile(dir=folder).close()
        except OSError:
            continue
        yield folder


def _places() -> Iterator[Path]:
    if chosen := os.environ.get("PIPELAY_CACHE"):
        yield Path(chosen)
    with contextlib.suppress(RuntimeError):  # no home directory
        yield Path.home() / ".cache" / "pipelay"
    with contextlib.suppress(OSError):  # no temporary directory
        shared, name = Path(tempfile.gettempdir()), f"pipelay-{getattr(os, 'geteuid', lambda: 'user')()}"
        for place in (shared / name, *sorted(shared.glob(f"{name}-*"))):  # anyone may have made them
            place.mkdir(mode=0o700, exist_ok=True)
            if _is_private(place.lstat()):
                yield place
        yield Path(tempfile.mkdtemp(prefix=f"{name}-", dir=shared))


def _is_private(folder: os.stat_result) -> bool:
    """Whether it is a folder of this user that neither group nor others may write to: what lies there is run."""
    mine = not hasattr(os, "geteuid") or folder.st_uid == os.geteuid()
    return mine and stat.S_ISDIR(folder.st_mode) and not (os.name == "posix" and folder.st_mode & (stat.S_IWGRP | stat.S_IWOTH))


def settle(bundled: Path) -> Path:
    """Copy the bundled package to its lasting place in one atomic move, unless it is there; mend what is not whole; returns that place."""
    for folder in cache_folders("units"):
        place = folder / bundled.name
        try:
            if not place.is_dir():
                with tempfile.TemporaryDirectory(dir=folder) as unfinished:
                    copy = shutil.copytree(bundled, Path(unfinished, bundled.name), copy_function=_copy)
                    with contextlib.suppress(OSError):  # another process was faster
                        copy.rename(place)
            _mend(place, bundled)
            os.utime(place)  # used just now
        except OSError:
            continue
        return place
    return bundled


def _copy(source: str | Path, target: str | Path) -> None:
    """A file, older than any kernels that came along or were compiled, which are then not taken for stale."""
    shutil.copy(source, target)
    if str(source).endswith(".py"):
        os.utime(target, (0, 0))


def _mend(place: Path, bundled: Path) -> None:
    """Make anew what a full disk or a loss of power has cut short: kernels go, files differing from the bundled ones are replaced."""
    for kernel in place.glob("**/__pycache__/*.nb[ci]"):
        with contextlib.suppress(FileNotFoundError):  # another process has dropped it
            if not _is_pickled(kernel):
                kernel.unlink()
                for mark in place.glob(COMPILED.format("*")):
                    mark.unlink(missing_ok=True)
    for source in (path for path in bundled.rglob("*") if path.is_file()):
        target = place / source.relative_to(bundled)
        if target.is_file() and (source.parent.name == "__pycache__" or target.read_bytes() == source.read_bytes()):
            continue
        with tempfile.TemporaryDirectory(dir=place.parent) as unfinished:
            copy = Path(unfinished, source.name)
            _copy(source, copy)
            target.parent.mkdir(parents=True, exist_ok=True)
            copy.replace(target)


def _is_pickled(kernel: Path) -> bool:
    """Whether numba's file ends as it should, with the opcode STOP; one in 256 of those cut short does too."""
    with kernel.open("rb") as file:
        return file.seek(0, os.SEEK_END) > 0 and file.seek(-1, os.SEEK_END) >= 0 and file.read() == b"."


def load() -> ModuleType:
    """The bundled package's module with the unit and its adapter, imported once in a process."""
    if PACKAGE not in sys.modules:
        place = settle(Path(__file__).parent / PACKAGE)
        try:
            return _import(place)
        except (EOFError, TypeError, ValueError):  # byte code that was cut short
            for code in place.rglob("*.pyc"):
                code.unlink(missing_ok=True)
            for name in [name for name in sys.modules if name.partition(".")[0] == PACKAGE]:
                del sys.modules[name]
            return _import(place)
    return importlib.import_module(f"{PACKAGE}.fmi_unit")


def _import(place: Path) -> ModuleType:
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
        """The slave that the loader's server instantiates."""

        unit_class = _unit.Unit
