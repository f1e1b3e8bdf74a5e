"""The licences of what an FMU carries, below ``documentation/licenses`` (FMI 2.0.4, 2.3)."""

from __future__ import annotations

import importlib.metadata
import re
import shutil
import subprocess
from pathlib import Path

FOLDER = "documentation/licenses"
_LICENSE = re.compile("licen[cs]e|copying|notice", re.IGNORECASE)


def entry(model: str, license_name: str, author: str) -> dict[str, bytes]:
    """The entry of the folder, ``license.txt``, as `of_package`."""
    text = (
        f"{model}: {license_name}, {author}.\n\n"
        "The folders beside this file hold, each under its name, the licences of pipelay, whose code this FMU is,\n"
        "and of what it carries of others: parts of PythonFMU and, in a portable FMU, Python, its packages and\nshared libraries.\n"
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


def of_system(name: str, file: Path) -> dict[str, bytes]:
    """The licence of a `file` of the system, as `of_package`: what its package says of it (Debian and its kin)."""
    if not shutil.which("dpkg-query"):
        return {}
    names = {str(file), str(file.resolve())}  # /lib or /usr/lib
    owner = subprocess.run(["dpkg-query", "-S", *names], capture_output=True, text=True).stdout.partition(":")[0]
    text = Path("/usr/share/doc", owner, "copyright")
    return {f"{FOLDER}/{name}/copyright": text.read_bytes()} if owner and text.is_file() else {}
