"""Folders for results: made when they are needed, and gone again if nothing came into them."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def gone_if_empty(folder: Path) -> Iterator[None]:
    """Remove on leaving, where they are empty, `folder` and those of its parents that are not there yet."""
    missing = [place for place in (folder, *folder.parents) if not place.exists()]
    try:
        yield
    finally:
        for made in missing:
            with contextlib.suppress(OSError):  # not empty, or never made
                made.rmdir()
