"""Compiles the loader, an FMU's binary (loader.c), once for a machine and version."""

from __future__ import annotations

import hashlib
import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
import zlib
from pathlib import Path

from ..errors import RunError

SOURCE = Path(__file__).with_name("loader.c")
FLAGS = ("-std=gnu11", "-O2", "-fPIC", "-fvisibility=hidden", "-shared", "-s")


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


def compiler() -> list[str]:
    """ziglang's compiler (for glibc 2.17, so for every Linux in use), else the machine's own. Raises RunError without either."""
    if importlib.util.find_spec("ziglang"):
        return [interpreter(), "-P", "-m", "ziglang", "cc", "-target", "x86_64-linux-gnu.2.17"]
    if found := shutil.which("cc"):
        return [found]
    raise RunError("no C compiler for the FMU's loader: pip install ziglang")


def library(folder: Path) -> bytes:
    """The loader for Linux x86-64, kept in `folder`. Raises RunError with the compiler's words where it fails."""
    command = [*compiler(), *FLAGS]
    place = folder / f"loader_{hashlib.sha256(SOURCE.read_bytes() + repr(command).encode()).hexdigest()[:12]}.so.z"
    try:
        return zlib.decompress(place.read_bytes())
    except (OSError, zlib.error):  # not there, or not whole
        folder.mkdir(parents=True, exist_ok=True)
        return _compiled(command, place)


def _compiled(command: list[str], place: Path) -> bytes:
    with tempfile.TemporaryDirectory(dir=place.parent, ignore_cleanup_errors=True) as work:  # a virus scanner may be at it
        made, packed = Path(work, "loader.so"), Path(work, "loader.so.z")
        caches = {"ZIG_GLOBAL_CACHE_DIR": work, "ZIG_LOCAL_CACHE_DIR": work}
        done = subprocess.run(
            [*command, "-o", str(made), str(SOURCE), "-ldl", "-lpthread"], env=os.environ | caches, capture_output=True, text=True
        )
        if done.returncode:
            raise RunError(f"the FMU's loader does not compile: {' '.join(done.stderr.split())[:1000]}")
        packed.write_bytes(zlib.compress(made.read_bytes()))
        packed.replace(place)
        return made.read_bytes()
