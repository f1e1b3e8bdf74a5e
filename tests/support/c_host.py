"""The C host of the tests (host.c): compiled, and run on an unpacked FMU with an empty environment."""

import shutil
import subprocess
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree

from master.fmi.loader import compiler

SOURCE = Path(__file__).with_name("host.c")


def compiled(folder: Path) -> Path:
    """The program, made in `folder`."""
    made = folder / "host"
    subprocess.run([*compiler(), "-o", str(made), str(SOURCE), "-ldl"], check=True)
    return made


def unpacked(fmu: Path, folder: Path) -> Path:
    """`folder`, anew and with the files of `fmu`, as an unzip that knows nothing of permissions leaves them."""
    shutil.rmtree(folder, ignore_errors=True)
    zipfile.ZipFile(fmu).extractall(folder)
    return folder


def command(
    host: str, folder: Path, seen_as: Path, wanted: Sequence[str], inputs: Mapping[str, float], step: float = 0.1, count: int = 5
) -> list[str]:
    """What starts `host` on the FMU unpacked in `folder`, which it sees at `seen_as`: `wanted` are printed, one a line."""
    model = ElementTree.parse(folder / "modelDescription.xml").getroot()
    references = {v.get("name"): v.get("valueReference") for v in model.iter("ScalarVariable")}
    library = next((folder / "binaries" / "linux64").glob("*.so")).relative_to(folder)
    given = [f"{references[name]}={value!r}" for name, value in inputs.items()]
    words = [host, seen_as / library, (seen_as / "resources").as_uri(), model.get("guid"), step, count, *given]
    return [*map(str, words), *(references[name] for name in wanted)]


def run(words: Sequence[str], **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a command in an environment of its own."""
    return subprocess.run(words, env=environment, capture_output=True, text=True, timeout=300)
