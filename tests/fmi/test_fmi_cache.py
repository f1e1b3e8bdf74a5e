"""The folder of cached code: the user's own, writable by nobody else, and whole; the same one however the interpreter is spelled."""

import os
import subprocess
import sys
import tempfile
import zlib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from time import sleep

import pytest
from units.toys import SPRING, spring_recipe

from master.fmi import build, entry, loader
from master.fmi.build import build_fmu, cached_fmu
from master.fmi.cache import cache_folder

PROGRAM = """
import sys
from master.fmu.instance import Fmu
with Fmu(sys.argv[1]) as fmu:
    fmu.initialize({"compiled": True, "hardening": 1.0, "offset": [2, 0, 0]})
    fmu.step(0.0, 0.1)
    kernel = next(module for name, module in sys.modules.items() if name.endswith(".kernel"))
    stats = kernel.cubic_mean.stats
    print(fmu.get("elastic_energy")[0], sum(stats.cache_hits.values()), kernel.__file__)
"""
ENERGY = 0.5 * 2.0**2 + 0.25 * 2.0**4  # of a spring of 1 N/m and 1 N/m3, 2 m long
STRANGER = 12345  # a user id


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return build_fmu(SPRING, tmp_path_factory.mktemp("fmus") / "spring.fmu")


def run(file: Path, **environment: str) -> tuple[float, int, Path]:
    """Energy, kernels found in the cache, and the place of the kernel's source."""
    command = [sys.executable, "-c", PROGRAM, str(file)]
    done = subprocess.run(command, env=os.environ | environment, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    energy, hits, place = done.stdout.split()
    return float(energy), int(hits), Path(place)


@pytest.fixture
def homeless(tmp_path, monkeypatch):
    """A temporary directory, and no other place for a cache."""
    (tmp_path / "home").write_text("in the way")
    (tmp_path / "tmp").mkdir()
    monkeypatch.delenv("PIPELAY_CACHE", raising=False)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))
    monkeypatch.setattr(tempfile, "tempdir", None)
    return tmp_path / "tmp"


def plant(file: Path, units: Path, mark: Path) -> None:
    """What the FMU would take for its own package, and what it would do then."""
    bundle = SPRING.bundle
    (units / bundle).mkdir(parents=True)
    (units / bundle / "__init__.py").write_text(f"open({str(mark)!r}, 'w').close()\n")


def given_to_stranger(place: Path) -> None:
    if os.geteuid():
        pytest.skip("only root may give a folder to another user")
    for path in (place, *place.rglob("*")):
        os.chown(path, STRANGER, STRANGER)


FOREIGN = {
    "of another user": given_to_stranger,
    "writable by the group": lambda place: place.chmod(0o770),
    "writable by all": lambda place: place.chmod(0o707),
    "behind a link": lambda place: place.symlink_to(place.rename(place.with_name("elsewhere"))),
}


@pytest.mark.parametrize("name", FOREIGN)
def test_code_in_a_folder_that_others_may_write_to_is_not_run_and_a_private_one_is_found_again(file, homeless, name):
    usual, mark = homeless / f"pipelay-{os.geteuid()}", homeless / "run"
    plant(file, usual / "units", mark)
    FOREIGN[name](usual)
    first, second = run(file), run(file)
    assert [it[:2] for it in (first, second)] == [(pytest.approx(ENERGY + 0.0), 0), (pytest.approx(ENERGY), 1)]
    assert not mark.exists()
    (place,) = homeless.glob(f"pipelay-{os.geteuid()}-*")
    assert place.stat().st_mode & 0o777 == 0o700
    assert first[2] == second[2]
    assert first[2].is_relative_to(place)
    assert cache_folder("fmus") == place / "fmus"


@pytest.mark.parametrize("mode", [0o770, 0o702])
def test_a_folder_of_code_that_others_may_write_to_is_not_used_in_the_chosen_place_either(homeless, monkeypatch, mode):
    chosen = homeless / "chosen"
    monkeypatch.setenv("PIPELAY_CACHE", str(chosen))
    assert next(entry.cache_folders("units")) == chosen / "units"
    (chosen / "units").chmod(mode)
    assert next(entry.cache_folders("units")) == homeless / f"pipelay-{os.geteuid()}" / "units"


def test_any_file_of_the_cache_that_was_cut_short_is_made_anew(file, tmp_path, monkeypatch):
    monkeypatch.delenv("PYTHONDONTWRITEBYTECODE", raising=False)
    cache = str(tmp_path)
    reference = run(file, PIPELAY_CACHE=cache)
    folder = reference[2].parent
    kinds = {".py", ".pyc", ".nbi", ".nbc"}
    files = [path for path in folder.rglob("*") if path.name.startswith(("kernel.", "__init__.", "slave."))]
    assert {path.suffix for path in files} == kinds
    for kind in sorted(kinds):
        sources = {path: path.read_bytes() for path in folder.rglob("*.py")}
        for part in (0.0, 0.5, 0.97):
            for path in files if kind != ".nbc" else folder.rglob("*.nbc"):
                if path.suffix == kind and path.is_file():
                    content = path.read_bytes()
                    path.write_bytes(content[: int(part * len(content))])
            energy, hits, _ = run(file, PIPELAY_CACHE=cache)
            assert energy == reference[0]
            assert hits == (kind in (".py", ".pyc"))  # the kernels are found as before
            assert {path: path.read_bytes() for path in folder.rglob("*.py")} == sources
        assert run(file, PIPELAY_CACHE=cache)[1] == 1


def test_an_fmu_or_a_loader_that_was_cut_short_is_made_anew(tmp_path, monkeypatch):
    monkeypatch.setenv("PIPELAY_CACHE", str(tmp_path))
    made = cached_fmu(spring_recipe(stiffness=2.0), tmp_path)
    (packed,) = (tmp_path / "loaders").glob("*.z")
    library, whole = zlib.decompress(packed.read_bytes()), packed.read_bytes()
    assert library[:4] == b"\x7fELF"
    for part in (0.0, 0.9):
        made.write_bytes(made.read_bytes()[: int(part * made.stat().st_size)])
        packed.write_bytes(whole[: int(part * len(whole))])
        assert cached_fmu(spring_recipe(stiffness=2.0), tmp_path) == made
        assert run(made, PIPELAY_CACHE=str(tmp_path))[0] > ENERGY
        assert loader.library(packed.parent) == library
        assert packed.read_bytes() == whole


def test_two_spellings_of_the_interpreter_are_one(tmp_path):
    """They would compile the kernels twice."""
    folder = Path(sys.executable).parent
    (tmp_path / "link").symlink_to(folder.parent)
    names = {path.name for path in folder.glob("python*") if path.resolve() == Path(sys.executable).resolve()}
    spellings = [*(folder / name for name in names), folder / ".." / folder.name / "python3", tmp_path / "link" / folder.name / "python3"]
    program = "from master.fmi.loader import interpreter as it; from units.toys import SPRING; print(it(), SPRING.bundle, SPRING.digest)"
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[1] / "support")}
    found = [subprocess.run([it, "-c", program], env=environment, capture_output=True, text=True, check=True).stdout for it in spellings]
    assert len(spellings) > 2
    assert len(set(found)) == 1
    prefix = "import sys; print(sys.prefix, sys.base_prefix)"
    own, other = (subprocess.run([it, "-c", prefix], capture_output=True, text=True).stdout for it in (sys.executable, found[0].split()[0]))
    assert own == other  # the same virtual environment


def test_kernels_are_compiled_once_for_all_who_ask_at_once_and_again_where_some_are_missing_or_of_another_processor(tmp_path, monkeypatch):
    monkeypatch.setenv("PIPELAY_CACHE", str(tmp_path))
    kernel = cache_folder("units") / SPRING.bundle / "__pycache__" / "kernel.nbi"
    called = []

    def compiled(*_):
        called.append(1)
        kernel.parent.mkdir(parents=True, exist_ok=True)
        kernel.write_bytes(b".")  # the first of many: the others take time
        sleep(0.2)

    monkeypatch.setattr(build, "_start", compiled)
    fmu = cached_fmu(SPRING, tmp_path)
    with ThreadPoolExecutor() as pool:
        list(pool.map(lambda _: build.compile_kernels(SPRING, fmu), range(4)))
    assert len(called) == 1
    monkeypatch.setenv("NUMBA_CPU_NAME", "generic")
    build.compile_kernels(SPRING, fmu)
    assert len(called) == 2
    kernel.write_bytes(b"")  # cut short
    entry._mend(kernel.parents[1], tmp_path / "nothing")
    kernel.write_bytes(b".")  # as another process begins anew
    build.compile_kernels(SPRING, fmu)
    assert len(called) == 3
    build.compile_kernels(SPRING, fmu)
    assert len(called) == 3
