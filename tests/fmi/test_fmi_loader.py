"""The loader of an exported FMU in a host that is not Python, with an empty environment."""

from pathlib import Path

import c_host
import pytest
from units.toys import BODY, SPRING, spring_recipe

from master.fmi.build import build_fmu
from master.fmu.instance import Fmu


@pytest.fixture(scope="module")
def host(tmp_path_factory):
    return c_host.compiled(tmp_path_factory.mktemp("host"))


def run(host: Path, fmu: Path, names: list[str], **environment: str):
    folder = c_host.unpacked(fmu, fmu.with_suffix(""))
    environment = {"PIPELAY_CACHE": str(fmu.parent / "cache")} | environment
    return c_host.run(c_host.command(str(host), folder, folder, names, {}), **environment)


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
