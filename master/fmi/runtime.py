"""Entry of an exported FMU's Python side: called in the host's interpreter, or run as a process of its own by the loader.

As a process it answers requests on the socket whose number is its argument, until the loader closes it. Every message
has its length before it (uint32). The first, its own, is a zero byte, or 1 and the reason why it cannot serve.
"""

import contextlib
import importlib
import os
import select
import signal
import sys
import threading
import time

GRACE = 1.0  # s to end of its own accord


def load(resources):  # type: ignore[no-untyped-def]
    """The function that answers requests, ``bytes -> bytes``. Raises ImportError with one line."""
    if sys.version_info < (3, 11):  # noqa: UP036  (any Python may be asked to run this)
        raise ImportError("Python 3.11 or later is needed, this is " + sys.version.split()[0])
    with _imports_from(resources):
        entry = importlib.import_module(_slave_module(resources))
        return importlib.import_module(entry.PACKAGE + ".fmi.server").Server(entry.Slave).answer


def load_in_host(resources):  # type: ignore[no-untyped-def]
    """The same in an interpreter that is not our own. Raises ImportError where it lacks what the FMU needs."""
    with _imports_from(resources):
        import numba  # noqa: F401
    return load(resources)


@contextlib.contextmanager
def _imports_from(resources):  # type: ignore[no-untyped-def]
    """The import path with `resources` first, and last the folders that the host runs in or lies in: modules there shadow nothing."""
    path = list(sys.path)
    here = ("", os.getcwd(), os.path.dirname(os.path.abspath(getattr(sys, "argv", [""])[0])))
    sys.path[:] = [resources] + [entry for entry in path if entry not in here] + [entry for entry in path if entry in here]
    try:
        yield
    finally:
        sys.path[:] = path


def end_with_reader(descriptor):  # type: ignore[no-untyped-def]
    """End this process, with those it has started if it leads them, once nobody holds the other end of `descriptor`, whatever it is at."""
    waiting = select.poll()
    waiting.register(descriptor, 0)  # an error or the end is reported unasked

    def end():  # type: ignore[no-untyped-def]
        waiting.poll()
        time.sleep(GRACE)
        if os.getpid() == os.getpgrp():
            os.killpg(0, signal.SIGKILL)
        os._exit(1)

    threading.Thread(target=end, daemon=True).start()


def _slave_module(resources):  # type: ignore[no-untyped-def]
    with open(os.path.join(resources, "slavemodule.txt"), encoding="utf-8") as file:
        return file.read().strip()


def serve(descriptor):  # type: ignore[no-untyped-def]
    """Answer requests until the socket closes."""
    end_with_reader(descriptor)
    with open(descriptor, "rb") as requests, open(os.dup(descriptor), "wb") as answers:

        def send(message):  # type: ignore[no-untyped-def]
            answers.write(len(message).to_bytes(4, sys.byteorder) + message)
            answers.flush()

        resources = os.path.dirname(os.path.abspath(__file__))
        os.environ.pop("NUMBA_DISABLE_JIT", None)  # meant for the host's own code
        try:
            answer = load(resources)
        except Exception as error:
            send(b"\1" + " ".join(str(error).split()).encode("utf-8", "replace") + b"\0")
            return
        send(b"\0")
        while True:
            size = requests.read(4)
            if not size:
                return
            send(answer(requests.read(int.from_bytes(size, sys.byteorder))))


if __name__ == "__main__":
    serve(int(sys.argv[1]))
