"""Kernels as machine code for any platform: from what numba has compiled for this one, by LLVM and zig, without a compiler installed.

numba keeps the intermediate code of every kernel that it compiles. That of a unit's four kernels (`native.py` of its package) is put into
one module, which LLVM turns into an object file for each platform; zig's C compiler links it with the C face (face.c, unit.c, kernels.c).
"""

from __future__ import annotations

import hashlib
import re
import struct
import tempfile
import zlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import llvmlite
import numba
from llvmlite import binding

from ...errors import RunError
from ...process.locks import locked
from . import windows, zig

HERE = Path(__file__).parent
SOURCES = ("face.c", "unit.c", "kernels.c", "face.h", "windows.c", "windows.py")
LAYOUT = ("unit.c", "kernels.c", "face.h", "tables.py", "export.py")  # what writes and reads the data of a unit
KERNELS = ("constants", "start", "step", "outputs")
FAST = ("step", "outputs")  # those that are there for the better kind of processor too
_MATH = "sqrt|hypot|pow|fmod|floor|exp|expm1|log|log10|a?(sin|cos|tan)h?|atan2|sincos"
NEEDED = re.compile(rf"NRT_\w+|numba_attempt_nocopy_reshape|release_reference|llvm\..*|mem(cpy|set|move)|{_MATH}")
FLAGS = ("-std=c11", "-O2", "-fvisibility=hidden", "-shared", "-s", "-ffp-contract=off")
_PAGE = 2**14  # bytes, of the processors of macOS
_RELEASE = "llvm.x86.atomic.sub.cc.i64"  # the one instruction of x86 in numba's code


@dataclass(frozen=True)
class Platform:
    """A platform of FMI: its folder in an FMU, the ending of its libraries, LLVM's and zig's names of it, its kinds of processor."""

    folder: str
    ending: str
    triple: str
    target: str
    levels: tuple[tuple[str, str], ...]  # "base" and, where the library chooses, "v3", with LLVM's names of processors


_X86 = (("base", "x86-64-v2"), ("v3", "x86-64-v3"))
PLATFORMS = (
    Platform("linux64", "so", "x86_64-unknown-linux-gnu", "x86_64-linux-gnu.2.17", _X86),
    Platform("win64", "dll", "x86_64-pc-windows-gnu", "x86_64-windows-gnu", _X86),
    Platform("darwin64", "dylib", "x86_64-apple-macosx11.0.0", "x86_64-macos", _X86[:1]),
    Platform("darwin64", "dylib", "arm64-apple-macosx11.0.0", "aarch64-macos", (("base", "apple-m1"),)),  # joined with the one above
)
ARM = Platform("linux64", "so", "aarch64-unknown-linux-gnu", "aarch64-linux-gnu.2.17", (("base", "generic"),))  # FMI 2 has no name for it


def own_platform() -> Platform:
    """The platform that this process runs on. Raises RunError where there is none for it."""
    triple = binding.get_default_triple()
    for platform in (*PLATFORMS, ARM):
        machine, _, rest = platform.triple.partition("-")
        if triple.startswith(machine) and any(name in triple and name in rest for name in ("linux", "windows", "apple")):
            return platform
    raise RunError(f"no FMUs in machine code for {triple}; export --python makes FMUs that run by Python")


class Machine:
    """The compiled kernels of a unit's module `native`, all of which must have been run."""

    def __init__(self, module: Any) -> None:
        self._name, self._names, libraries = module.__name__, {}, []
        for kernel in KERNELS:
            (compiled,) = getattr(module, f"unit_{kernel}").overloads.values()
            self._names[compiled.fndesc.llvm_func_name] = kernel
            libraries.append(compiled.library)
        self._text = self._joined(libraries)

    def _joined(self, libraries: Iterable[Any]) -> str:
        """The intermediate code of all kernels in one module, of which only they can be called from outside."""
        whole: Any = None
        for library in libraries:
            module = binding.parse_bitcode(library._get_module_for_linking().as_bitcode())
            for function in module.functions:
                if not function.is_declaration:
                    function.add_function_attribute("nounwind")  # no tables to unwind it by
                    function.linkage = "external" if function.name in self._names else "linkonce_odr"  # one of each
            if whole is None:
                whole = module
            else:
                whole.link_in(module)
        for value in (*whole.functions, *whole.global_variables):
            if not value.is_declaration and value.name not in self._names:
                value.linkage = "internal"
        text = re.sub(rf"declare [^\n]*@{re.escape(_RELEASE)}\([^\n]*", "declare i8 @release_reference(ptr, i64, i32)", str(whole))
        return text.replace(f"@{_RELEASE}", "@release_reference").replace("@_hypot(", "@hypot(")  # its name on Windows

    def object_file(self, platform: Platform, level: str) -> bytes:
        """Object file for a platform and a level of its processors. Raises RunError where the kernels need what is not there."""
        binding.initialize_all_targets()
        binding.initialize_all_asmprinters()
        target = binding.Target.from_triple(platform.triple)
        machine = target.create_target_machine(cpu=dict(platform.levels)[level], features="", opt=3, reloc="pic", codemodel="default")
        text = re.sub(r'target triple = "[^"]*"', f'target triple = "{platform.triple}"', self._text)
        module = binding.parse_assembly(re.sub(r'target datalayout = "[^"]*"', f'target datalayout = "{machine.target_data}"', text))
        for name, kernel in self._names.items():
            if level == "base" or kernel in FAST:
                module.get_function(name).name = f"kernel_{kernel}_{level}"
            else:
                module.get_function(name).linkage = "internal"
        builder = binding.create_pass_builder(machine, binding.create_pipeline_tuning_options(speed_level=2))
        passes = binding.create_new_module_pass_manager()
        passes.add_global_dead_code_eliminate_pass()
        passes.run(module, builder)
        if foreign := [f.name for f in module.functions if f.is_declaration and not NEEDED.fullmatch(f.name)]:
            raise RunError(f"the kernels of {self._name} cannot run without Python: they need {', '.join(foreign)}")
        return bytes(machine.emit_object(module))


def kinship(key: str) -> int:
    """A number that a unit's library and its data have in common: of its package, whose hash is `key`, and of the layout of the data."""
    digest = hashlib.sha256(key.encode())
    for source in LAYOUT:
        digest.update((HERE / source).read_bytes())
    return int.from_bytes(digest.digest()[:8], "little")


def kept(platform: Platform, name: str, key: str, folder: Path) -> Path:
    """Where the library of a unit for a platform is kept in `folder`, by the hash `key` of its package."""
    facts = repr((kinship(key), platform, FLAGS, numba.__version__, llvmlite.__version__)).encode()
    facts += b"".join((HERE / source).read_bytes() for source in (*SOURCES, "machine.py"))
    return folder / f"{name}_{platform.folder}_{hashlib.sha256(facts).hexdigest()[:12]}.z"


def library(machine: Callable[[], Machine], platform: Platform, name: str, key: str, folder: Path) -> bytes:
    """The shared library of a unit for a platform, made if it is not `kept`. Raises RunError."""
    place = kept(platform, name, key, folder)
    try:
        return zlib.decompress(place.read_bytes())
    except (OSError, zlib.error):  # not there, or not whole
        folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder, ignore_cleanup_errors=True) as work:  # a virus scanner may be at it
        objects = []
        for level, _ in platform.levels:
            objects.append(Path(work, f"{level}.o"))
            objects[-1].write_bytes(machine().object_file(platform, level))
        made, packed = Path(work, f"unit.{platform.ending}"), Path(work, "packed")
        link(platform, objects, made, folder, f"-DKERNELS={kinship(key)}u")
        packed.write_bytes(zlib.compress(made.read_bytes()))
        packed.replace(place)
        return made.read_bytes()


def joined(libraries: Sequence[bytes]) -> bytes:
    """One library of macOS for several kinds of processor, each in pages of its own behind a table of them; a single one as it is."""
    if len(libraries) == 1:
        return libraries[0]
    table, content = struct.pack(">2I", 0xCAFEBABE, len(libraries)), b""
    for library in libraries:
        content += bytes(-len(content) % _PAGE)
        kind = struct.unpack_from("<2I", library, 4)
        table += struct.pack(">5I", *kind, _PAGE + len(content), len(library), _PAGE.bit_length() - 1)
        content += library
    return table.ljust(_PAGE, b"\0") + content


def link(platform: Platform, objects: Sequence[Path], made: Path, folder: Path, *flags: str) -> None:
    """Compile the C face and link it. Raises RunError with the compiler's words where it fails."""
    several = ["-DLEVELS"] if len(objects) > 1 else []
    sources = [str(HERE / source) for source in SOURCES if source.endswith(".c") and source != "windows.c"]
    plain = ["-fPIC", "-lm", *(["-Wl,-install_name,unit.dylib"] if platform.ending == "dylib" else [])]  # else that of the folder here
    end = windows.arguments(made.parent) if platform.ending == "dll" else plain
    files = ["-o", str(made), *sources, *map(str, objects)]
    command = [*zig.COMMAND, "cc", "-target", platform.target, *FLAGS, *several, *flags, *files, *end]
    with locked(folder):
        zig.run(command, folder, f"the FMU's library for {platform.folder} cannot be made")
