"""The loader of an exported FMU in a host that is not Python, with an empty environment."""

import shutil
import subprocess
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import pytest
from units.toys import BODY, SPRING, spring_recipe

from master.fmi.build import build_fmu
from master.fmi.loader import compiler
from master.fmu import Fmu

SOURCE = Path(__file__).with_name("host.c")


@pytest.fixture(scope="module")
def host(tmp_path_factory):
    made = tmp_path_factory.mktemp("host") / "host"
    subprocess.run([*compiler(), "-o", str(made), str(SOURCE), "-ldl"], check=True)
    return made


def run(host: Path, fmu: Path, names: list[str], **environment: str) -> subprocess.CompletedProcess[str]:
    folder = fmu.with_suffix("")
    shutil.rmtree(folder, ignore_errors=True)
    zipfile.ZipFile(fmu).extractall(folder)
    model = ElementTree.parse(folder / "modelDescription.xml").getroot()
    references = {v.get("name"): v.get("valueReference") for v in model.iter("ScalarVariable")}
    library = next((folder / "binaries" / "linux64").glob("*.so"))
    uri = (folder / "resources").as_uri()
    command = [host, library, uri, model.get("guid"), "0.1", "5", *(references[name] for name in names)]
    environment = {"PIPELAY_CACHE": str(fmu.parent / "cache")} | environment
    return subprocess.run(list(map(str, command)), env=environment, capture_output=True, text=True, timeout=120)


@pytest.mark.parametrize("recipe", [spring_recipe(stiffness=7.0, offset=[1.0, 0.0, 0.0]), BODY], ids=["spring", "body"])
def test_a_c_host_gets_what_a_python_host_gets(host, tmp_path, recipe):
    fmu = build_fmu(recipe, tmp_path / "a b #1" / "unit.fmu")
    names = ["force[1]", "force[2]"] if recipe is not BODY else ["position[1]", "position[3]"]
    done = run(host, fmu, names)
    assert (done.returncode, done.stderr) == (0, "")
    with Fmu(fmu) as same:
        same.initialize()
        for i in range(5):
            same.step(0.1 * i, 0.1)
        assert list(map(float, done.stdout.split())) == [same.get(name.partition("[")[0])[int(name[-2]) - 1] for name in names]


@pytest.mark.parametrize(
    ("python", "message"),
    [("/absent/python", "No such file or directory"), ("/bin/false", "ended at its start, exit code 1")],
)
def test_without_its_python_it_says_so_and_the_host_lives(host, tmp_path, python, message):
    done = run(host, build_fmu(SPRING, tmp_path / "spring.fmu"), [], PIPELAY_PYTHON=python)
    assert done.returncode == 1
    assert f"Python {python}" in done.stderr
    assert message in done.stderr
    assert "PIPELAY_PYTHON" in done.stderr
