"""The program: `pipelay`, or `python -m master`. From here on Ctrl-C ends it in one line, while `master.command_line` loads too."""

import os
import sys

if __name__ == "__main__" and os.name == "posix" and not sys.flags.safe_path:
    # begin anew without the working folder, whose modules Python would prefer
    os.execv(sys.executable, [sys.executable, "-P", *sys.orig_argv[1:]])

import signal


def main(arguments: list[str] | None = None) -> int:
    """Run one command in this process and return its exit code."""
    from master.command_line import main

    return main(arguments)


def program() -> int:
    """Run the command of the shell's call in a process of its own and return its exit code."""
    for which in (signal.SIGINT, signal.SIGTERM):
        signal.signal(which, _interrupted)
    from master.command_line import program

    return program()


def _interrupted(*_: object) -> None:
    """Before there is anything to close."""
    os.write(2, b"pipelay: interrupted\n")
    os._exit(1)


if __name__ == "__main__":
    sys.exit(program())
