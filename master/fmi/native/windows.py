"""Linking for Windows with the system's own C library alone.

zig would compile the whole of mingw's for it, which takes minutes; what the C face and the kernels need of Windows is in the C library that
comes with it (UCRT, Windows 10 and later), of which import libraries are made from lists of names.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping
from pathlib import Path

from . import zig

HERE = Path(__file__).parent
IMPORTS = {
    "api-ms-win-crt-heap-l1-1-0": "malloc calloc free",
    "api-ms-win-crt-string-l1-1-0": "memset strlen strcmp strncmp strspn strcspn strpbrk strcat strcpy",
    "api-ms-win-crt-private-l1-1-0": "memcpy memcmp memmove memchr strchr",
    "api-ms-win-crt-stdio-l1-1-0": "__stdio_common_vsprintf _wfopen fread fseek ftell rewind fclose",
    "api-ms-win-crt-runtime-l1-1-0": "strerror _errno",
    "api-ms-win-crt-convert-l1-1-0": "strtod",
    "api-ms-win-crt-math-l1-1-0": "sin cos tan atan atan2 tanh exp expm1 fmod log log10 pow floor sqrt _hypot",
    "kernel32": "MultiByteToWideChar",
}


def arguments(work: Path, entry: str = "DllMain", more: Mapping[str, str] | None = None) -> list[str]:
    """What zig is given to link for Windows, beside the sources; files are made in the folder `work`.

    entry: the function that is called first; more: names of functions by library that are needed beside IMPORTS. Raises RunError.
    """
    found = importlib.util.find_spec("ziglang")
    headers = Path(str(found.origin)).parent / "lib/libc/include/any-windows-any" if found else work
    libraries = []
    for name, known in IMPORTS.items():
        functions = f"{known} {(more or {}).get(name, '')}"
        definition, library = work / f"{name}.def", work / f"{name}.lib"
        definition.write_text("\n".join([f"LIBRARY {name}.dll", "EXPORTS", *functions.split(), ""]))
        made = ["dlltool", "-m", "i386:x86-64", "-d", str(definition), "-l", str(library)]
        zig.run([*zig.COMMAND, *made], work, "the FMU's library for Windows cannot be made")
        libraries.append(str(library))
    defined = ["-D_UCRT", "-D__MSVCRT_VERSION__=0xE00", "-D__USE_MINGW_ANSI_STDIO=0"]
    plain = ["-nostdlib", f"-Wl,-e,{entry}", "-isystem", str(headers), *defined]
    return [*plain, str(HERE / "windows.c"), *libraries]
