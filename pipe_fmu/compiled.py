"""Compilation of the kernels: plain arrays in, plain arrays out, cached on disk.

numba looks at a kernel's own file to see whether its cached code is still good, but not at the files of the kernels it
calls. So when any source of the package is newer than a cache index, all indices of the package are dropped and
everything is compiled afresh.

An `inner` kernel allocates no array, so those it is given need no counting of references, which would cost more than its arithmetic; sums
may be rearranged in it (fused multiply-add), while NaN and infinity keep their meaning. An `inlined` kernel is compiled as a part of the
one that calls it, which spares the time to compile it by itself.
"""

import math
import os
from pathlib import Path
from typing import Any

from numba import config, njit


def drop_stale_cache(package: Path) -> int:
    """Remove numba's cache indices of the package folder if one is older than a source; return how many were removed."""
    indices = list(package.rglob("__pycache__/*.nbi"))
    if not os.access(package, os.W_OK):
        return 0  # numba keeps its cache elsewhere
    newest = max(source.stat().st_mtime for source in package.rglob("*.py"))
    if all(_modified(index) >= newest for index in indices):
        return 0
    for index in indices:
        index.unlink(missing_ok=True)
    return len(indices)


def _modified(index: Path) -> float:
    """When a file was last written; one that another process has just dropped is as good as new."""
    try:
        return index.stat().st_mtime
    except FileNotFoundError:
        return math.inf


if config.DISABLE_JIT:  # type: ignore[attr-defined]
    raise ImportError("NUMBA_DISABLE_JIT is set, but the kernels can only run compiled")
drop_stale_cache(Path(__file__).parent)

_PLAIN: dict[str, Any] = {"cache": True, "error_model": "numpy", "no_cfunc_wrapper": True}
_BARE: dict[str, Any] = {"_nrt": False, "fastmath": {"contract", "arcp", "nsz", "reassoc"}}
kernel = njit(**_PLAIN)
inlined = njit(**_PLAIN, inline="always")
inner = njit(**_PLAIN, **_BARE)
