"""A Python that travels inside an FMU: this interpreter, its standard library, numpy and numba (Linux x86-64, glibc).

Everything lies below ``resources/python/linux64``, where the loader looks for it, as an installation of its own: ``bin/python3``,
``lib`` with the shared libraries that a plain system lacks, and the packages within the standard library, so that no environment
variable, no configuration and no installed Python is needed. Byte code is compiled beforehand and not compared with the sources, whose
dates unpacking changes. Licences go to ``documentation/licenses``.

A unit's kernels are compiled at export for x86-64-v3 (AVX2: every processor since about 2015), and found by numba in its cache; on a
processor without these instructions they are compiled at the first start, for that processor.
"""

from __future__ import annotations

import compileall
import hashlib
import importlib.metadata
import os
import platform
import py_compile
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterator
from pathlib import Path

from ..errors import RunError
from . import licenses

HOME = "resources/python/linux64"
PACKAGES = ("numpy", "llvmlite", "numba")
EPOCH = (1980, 1, 1, 0, 0, 0)  # the earliest date a zip archive can hold: equal contents, equal bytes
PROCESSOR = b"x86-64-v3 cx16 sahf popcnt sse4.1 sse4.2 ssse3 avx avx2 bmi bmi2 f16c fma lzcnt movbe xsave"  # LLVM's names: kind, features
_GLIBC = re.compile(r"(ld-linux-x86-64|lib(c|m|dl|rt|pthread|util|resolv|anl|mvec))\.so")
_NOT_NEEDED = (
    # of the standard library: what develops, tests and draws, and extension modules that have libraries of their own
    "test", "tests", "idle_test", "idlelib", "lib2to3", "tkinter", "turtledemo", "turtle.py", "ensurepip", "venv", "distutils",
    "pydoc_data", "config-*", "site-packages", "dist-packages", "__pycache__", "sitecustomize.py", "_ssl.*", "_hashlib.*", "_sqlite3.*",
    "_tkinter.*", "_curses*", "readline.*", "_dbm.*", "_gdbm.*", "nis.*", "_crypt.*", "_bz2.*", "_lzma.*", "_uuid.*", "_test*", "_xxtest*",
    "xxlimited*",
    # of the packages
    "f2py", "cuda", "tbbpool.*", "omppool.*", "_pyinstaller", "include", "*.pyi", "*.pxd", "*.h", "*.c", "*.cpp", "*.a",
)  # fmt: skip


def interpreter() -> str:
    """Path of this interpreter, one however it was spelled: without links, but for the one that leads out of a virtual environment."""
    path = Path(sys.executable)
    path = path.parent.resolve() / path.name
    while path.is_symlink():
        target = path.parent / path.readlink()
        target = target.parent.resolve() / target.name
        if sys.prefix != sys.base_prefix and target.parent != path.parent:
            break
        path = target
    return str(path)


def archive(folder: Path) -> Path:
    """Zip file of the runtime and its licences by their places in an FMU, kept in `folder`. Raises RunError on another platform."""
    if (platform.system(), platform.machine(), platform.libc_ver()[0]) != ("Linux", "x86_64", "glibc"):
        raise RunError(f"--portable: works on Linux x86-64 with glibc, this is {platform.platform()}")
    versions = [f"{name} {importlib.metadata.version(name)}" for name in PACKAGES]
    facts = "\n".join([Path(__file__).read_text(encoding="utf-8"), sys.version, interpreter(), *versions])
    place = folder / f"python_{hashlib.sha256(facts.encode()).hexdigest()[:12]}.zip"
    if not zipfile.is_zipfile(place):
        with tempfile.TemporaryDirectory(dir=folder) as work:
            tree, packed = Path(work, "tree"), Path(work, "packed.zip")
            _collect(tree)
            _pack(tree, packed)
            packed.replace(place)
    return place


def kernels(resources: Path, unit: Path, step: float) -> dict[str, bytes]:
    """Files of numba's cache, by their places, in the folder `unit` where the FMU unpacked in `resources` settles, after one start of it.

    Raises RunError if it does not start.
    """
    command = [sys.executable, "-I", "-B", str(Path(__file__).with_name("warm.py")), str(resources), str(step)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise RunError(f"the FMU does not start: {' '.join(done.stderr.split())[-1000:]}")
    return {path.relative_to(unit).as_posix(): path.read_bytes() for path in sorted(unit.rglob("*.nb[ci]"))}


def _collect(tree: Path) -> None:
    """The runtime as a folder tree."""
    home = tree / HOME
    library = home / sys.platlibdir / f"python{sys.version_info.major}.{sys.version_info.minor}"
    unneeded = shutil.ignore_patterns(*_NOT_NEEDED)
    standard = Path(os.__file__).parent
    shutil.copytree(standard, library, ignore=unneeded)
    own = {f"{licenses.FOLDER}/python/{path.name}": path.read_bytes() for path in standard.glob("LICENSE*")}
    texts = own or licenses.of_system("python", Path(os.__file__))
    for name in PACKAGES:
        package = Path(str(importlib.metadata.distribution(name).locate_file(name)))
        shutil.copytree(package, library / name, ignore=unneeded)
        if (shared := package.with_name(f"{name}.libs")).is_dir():
            shutil.copytree(shared, library / shared.name)
        texts |= licenses.of_package(name)
    (home / "bin").mkdir()
    shutil.copy(Path(sys.executable).resolve(), home / "bin" / "python3")
    for library_name, path in _foreign_libraries(home):
        shutil.copy(path, home / "lib" / library_name)
        texts |= licenses.of_system(library_name, path)
    for name, text in texts.items():
        place = tree / name
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(text)
    compileall.compile_dir(library, quiet=2, invalidation_mode=py_compile.PycInvalidationMode.UNCHECKED_HASH)


def _foreign_libraries(home: Path) -> Iterator[tuple[str, Path]]:
    """Name and place of the shared libraries from outside `home` that its binaries need, without those of glibc."""
    binaries = [home / "bin" / "python3", *home.rglob("*.so"), *home.rglob("*.so.*")]
    listed = subprocess.run(["ldd", *map(str, binaries)], capture_output=True, text=True, check=True).stdout
    for name, path in sorted(set(re.findall(r"^\s+(\S+) => (.*?)(?: \(0x.*)?$", listed, re.MULTILINE))):
        if path == "not found":
            raise RunError(f"--portable: the library {name} cannot be found")
        if not _GLIBC.match(name) and not path.startswith(str(home)):
            yield name, Path(path)


def _pack(tree: Path, packed: Path) -> None:
    """Zip a folder tree in fixed order and with fixed dates."""
    with zipfile.ZipFile(packed, "w") as target:
        for path in sorted(path for path in tree.rglob("*") if path.is_file()):
            entry = zipfile.ZipInfo(path.relative_to(tree).as_posix(), EPOCH)
            entry.external_attr = path.stat().st_mode << 16
            target.writestr(entry, path.read_bytes(), zipfile.ZIP_DEFLATED)
