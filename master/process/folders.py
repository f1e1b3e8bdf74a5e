"""Folders for results: made when they are needed, for one process at a time, and gone again if nothing came into them."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Iterator
from pathlib import Path

from master.errors import UsageError
from master.process.locks import locked

SCRATCH = ".pipelay-"  # begins the names of folders for files in the making


@contextlib.contextmanager
def taken(folder: Path) -> Iterator[None]:
    """`folder`, made if need be, for this process alone, without what a killed one has left in the making.

    On leaving it goes if it is empty, and those of its parents that were not there. Raises UsageError where it cannot be made, or
    another process is at it.
    """
    missing: list[Path] = []
    with contextlib.ExitStack() as stack:
        try:
            missing += [place for place in (folder, *folder.parents) if not place.exists()]
            folder.mkdir(parents=True, exist_ok=True)
            stack.enter_context(locked(folder, wait=False))
            folder.mkdir(parents=True, exist_ok=True)  # another process may just have left it
        except BlockingIOError:
            raise UsageError(f"--output = {str(folder)!r}: another run is writing there; wait for it, or name another folder") from None
        except OSError as error:
            _remove_empty(missing)
            raise unwritable(folder, error) from None
        stack.callback(_remove_empty, missing)  # before it is anybody's
        for left in folder.glob(f"{SCRATCH}*"):
            shutil.rmtree(left, ignore_errors=True)
        yield


def unwritable(folder: Path, error: OSError) -> UsageError:
    """What to say of a folder for results in which nothing can be made."""
    return UsageError(f"--output = {str(folder)!r}: cannot be written ({error.strerror})")


def _remove_empty(folders: list[Path]) -> None:
    for made in folders:
        with contextlib.suppress(OSError):  # not empty, or never made
            made.rmdir()
