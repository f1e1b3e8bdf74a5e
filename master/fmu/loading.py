"""An FMU's file becomes an instance in this process, by FMPy, and is freed again."""

from __future__ import annotations

import contextlib
import ctypes
import os
import tempfile
from pathlib import Path
from typing import Any

import fmpy
from fmpy import fmi2
from fmpy.fmi1 import FMICallException

from .errors import FmuFailed
from .messages import Messages, callbacks, last_words

Folder = tempfile.TemporaryDirectory[str]


def read(path: str | Path) -> Any:
    """FMPy's model description of the FMU file `path`. Raises FmuFailed if it is none for co-simulation by FMI 2.0."""
    try:
        model = fmpy.read_model_description(str(path), validate=False)
    except Exception as error:  # FMPy raises whatever its parsers raise
        raise FmuFailed(f"{path}: not a readable FMU: {error}") from None
    if model.coSimulation is None or not model.fmiVersion.startswith("2."):
        raise FmuFailed(f"{path}: not an FMU for co-simulation by FMI 2.0")
    return model


def instantiated(path: str | Path, model: Any, name: str, messages: Messages) -> tuple[Any, Folder]:
    """FMPy's instance `name` of the FMU, which logs into `messages`, and the folder of the unpacked files. Raises FmuFailed."""
    folder = tempfile.TemporaryDirectory(prefix="fmu_", ignore_cleanup_errors=True)  # Windows keeps a library that is loaded
    location = Path(folder.name, "resources").as_uri()
    if (model.generationTool or "").startswith("PythonFMU"):  # which knows no escape but that of the blank
        location = f"file://{folder.name}/resources".replace(" ", "%20")
        if "%20" in folder.name:  # it would crash
            raise FmuFailed(f"{name}: FMUs of PythonFMU cannot be unpacked in {folder.name}; set TMPDIR to a path without %20")
    try:
        fmpy.extract(str(path), folder.name)
        identifier = model.coSimulation.modelIdentifier
        fmu = fmi2.FMU2Slave(guid=model.guid, modelIdentifier=identifier, unzipDirectory=folder.name, instanceName=name)
        fmu.callbacks = callbacks(messages)
        words = name.encode(), fmi2.fmi2CoSimulation, model.guid.encode(), os.fsencode(location)
        fmu.component = fmu.fmi2Instantiate(*words, ctypes.byref(fmu.callbacks), False, True)
        if not fmu.component:
            raise FmuFailed("failed to instantiate")
    except Exception as error:  # as above; the FMU's own words are in the log
        folder.cleanup()
        raise FmuFailed(f"{name}: cannot be loaded: {last_words(messages, str(error))}") from None
    return fmu, folder


def free(fmu: Any, states: set[int], folder: Folder) -> None:
    """Free the saved states, the instance, the unpacked files; PythonFMU crashes a process that exits with living instances."""
    with contextlib.suppress(FMICallException):
        while states:
            fmu.freeFMUstate(ctypes.c_void_p(states.pop()))
    fmu.freeInstance()
    folder.cleanup()
