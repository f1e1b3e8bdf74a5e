"""zig's C compiler and linker, which come as a Python package."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from ...errors import RunError

COMMAND = (sys.executable, "-P", "-m", "ziglang")


def run(command: Sequence[str], folder: Path, what: str) -> None:
    """Run a command of zig, which keeps what it makes for all in `folder`. Raises RunError with `what` and zig's words where it fails."""
    caches = {"ZIG_GLOBAL_CACHE_DIR": str(folder / "zig"), "ZIG_LOCAL_CACHE_DIR": str(folder / "zig")}
    done = subprocess.run(command, env=os.environ | caches, capture_output=True, encoding="utf-8", errors="replace")
    if done.returncode:
        raise RunError(f"{what}: {' '.join(done.stderr.split())[:1000]}")
