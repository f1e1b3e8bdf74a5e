"""What is kept between runs, by content: FMUs, unit packages with their kernels, loaders, runtimes; of each kind the latest used."""

from __future__ import annotations

import contextlib
import os
import tempfile
import time
from pathlib import Path

from ..errors import RunError
from . import entry

DAY, MINUTE = 86400.0, 60.0  # s
KEPT = {"fmus": (200, MINUTE), "units": (16, DAY), "loaders": (8, MINUTE), "libraries": (32, DAY)}
"""How many of each kind, and how long after its use nothing goes: another process may be about to read it."""


def cache_folder(kind: str) -> Path:
    """Where files of a kind are kept, as `entry` has it for FMUs. Raises RunError."""
    folder = next(entry.cache_folders(kind), None)
    if folder is None:
        raise RunError("no folder can be written for the FMUs; set PIPELAY_CACHE to one that can")
    return folder


def used(path: Path) -> bool:
    """Note that `path` is used now; whether it is there."""
    try:
        os.utime(path)
    except OSError:
        return False
    return True


def bound() -> None:
    """Remove what was used longest ago, beyond the number kept of each kind; other processes may do so at the same time."""
    for kind, (number, recent) in KEPT.items():
        oldest = time.time() - recent
        with contextlib.suppress(OSError, RunError):
            folder = cache_folder(kind)
            ages = {path: path.lstat().st_mtime for path in folder.iterdir()}
            unused = sorted((path for path in ages if ages[path] < oldest), key=ages.__getitem__)
            for path in unused[: max(0, len(ages) - number)]:
                with contextlib.suppress(OSError), tempfile.TemporaryDirectory(dir=folder) as grave:  # it may be gone already
                    path.rename(Path(grave, path.name))  # at once, whatever is in it
