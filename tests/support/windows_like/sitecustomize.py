"""Lets the program's own modules see what Windows has of the standard library, in any Python that has this folder in PYTHONPATH.

Only what is looked up in a module of ours is missing, forbidden or named otherwise: libraries, and the standard library itself, go on as
they are on this machine.
"""

import builtins
import os
import select
import signal
import sys
import types

from not_there import MISSING, MODULES

OURS = ("master", "pipe_fmu", "vessel_fmu")
OTHER = {("os", "name"): "nt", ("sys", "platform"): "win32"}
frame, attribute = sys._getframe, types.ModuleType.__getattribute__


def ours() -> bool:
    """Whether a module of ours is at it."""
    caller = frame(2)
    name = caller.f_globals.get("__name__", "")
    main = caller.f_code.co_filename if name == "__main__" else ""
    return name.partition(".")[0] in OURS or any(f"/{one}/" in main for one in OURS)


class Seen(types.ModuleType):
    """A module in which ours do not find what is missing."""

    def __getattribute__(self, name: str) -> object:
        it = attribute(self, "__name__")
        if name in MISSING.get(it, ()) and ours():
            raise AttributeError(f"module {it!r} of Windows has no attribute {name!r}")
        if (it, name) in OTHER and ours():
            return OTHER[it, name]
        return attribute(self, name)


def open_file(path, flags, *more, **options):  # type: ignore[no-untyped-def]
    """os.open, which on Windows opens no folder."""
    if ours() and not isinstance(path, int) and os.path.isdir(path):
        raise PermissionError(13, "Permission denied", str(path))
    return open_there(path, flags, *more, **options)


def importing(name, globals=None, *more, **options):  # type: ignore[no-untyped-def]
    """__import__, which on Windows does not find some modules."""
    if name in MODULES and (globals or {}).get("__name__", "").partition(".")[0] in OURS:
        raise ModuleNotFoundError(f"No module named {name!r}", name=name)
    return import_there(name, globals, *more, **options)


open_there, os.open = os.open, open_file
import_there, builtins.__import__ = builtins.__import__, importing
for module in (os, select, signal, sys):
    module.__class__ = Seen
