"""The run's side of `master.with_units.prepare`: that process validates a scene, solves its equilibrium and exports its FMUs.

It is a process of its own because it works with the units' own packages, while a process that runs FMUs knows them by
file and port names only.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from master.errors import RunError, UsageError
from master.process.signals import postponed
from master.scene.reading import Scene, simulated

COMMAND = (sys.executable, "-P", "-m", "master.with_units.prepare")  # not with modules of the working folder


def prepare(scene: Scene, arguments: Sequence[str] = ()) -> dict[str, Path]:
    """FMU files by unit name of a scene, prepared by the child process, called with `arguments`.

    Raises UsageError for what the units refuse in the scene, RunError without an equilibrium or a child breaking off.
    """
    simulated(scene.sections)
    request = json.dumps(scene.mapping, default=str)
    # a session of its own: Ctrl-C is for this process, which then ends the child
    with postponed() as asked:  # an exception within Popen would leave the child behind
        child = subprocess.Popen([*COMMAND, *arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True)
        early = asked.is_set()
    with child:
        try:
            if early:
                raise KeyboardInterrupt
            output, _ = child.communicate(request)
        except BaseException:
            _kill(child)
            child.wait()
            raise
    try:
        answer = json.loads(output)
    except ValueError:
        raise RunError(f"preparing the scene broke off with exit code {child.returncode}") from None
    if "error" in answer:
        raise (UsageError if answer.get("exit") == 2 else RunError)(answer["error"])
    return {name: Path(path) for name, path in answer["fmus"].items()}


def _kill(child: subprocess.Popen[str]) -> None:
    """End `child`, and those that it has started, which it leads; on Windows these come to their end."""
    if not hasattr(os, "killpg"):
        child.kill()
        return
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child.pid, signal.SIGKILL)
