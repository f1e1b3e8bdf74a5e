"""The licences of what an FMU carries, below ``documentation/licenses`` (FMI 2.0.4, 2.3)."""

from __future__ import annotations

import importlib.metadata
import re
from pathlib import Path

FOLDER = "documentation/licenses"
_LICENSE = re.compile("licen[cs]e|copying|notice", re.IGNORECASE)


def entry(model: str, license_name: str, author: str) -> dict[str, bytes]:
    """The entry of the folder, ``license.txt``, as `of_package`."""
    text = (
        f"{model}: {license_name}, {author}.\n\n"
        "The folders beside this file hold, each under its name, the licences of pipelay, whose code this FMU is,\n"
        "and of what it carries of others: parts of PythonFMU.\n"
    )
    return {f"{FOLDER}/license.txt": text.encode()}


def of_package(name: str) -> dict[str, bytes]:
    """Licence files of an installed Python package by their places in an FMU; none if it is not installed."""
    try:
        files = importlib.metadata.files(name) or ()
    except importlib.metadata.PackageNotFoundError:
        return {}
    return {
        f"{FOLDER}/{name}/{str(file).replace('/', '_')}": Path(str(file.locate())).read_bytes()
        for file in files
        if _LICENSE.match(file.name) and file.suffix not in (".py", ".pyc")
    }
