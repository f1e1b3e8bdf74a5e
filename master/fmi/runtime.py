"""Entry of an exported FMU's Python side: called in the host's interpreter, or run as a process of its own by the loader.

As a process it answers requests on the socket whose number is its argument, until the loader closes it. Every message
has its length before it (uint32). The first, its own, is a zero byte, or 1 and the reason why it cannot serve.
"""

import importlib
import os
import sys


def load(resources):  # type: ignore[no-untyped-def]
    """The function that answers requests, ``bytes -> bytes``. Raises ImportError with one line."""
    if sys.version_info < (3, 11):  # noqa: UP036  (any Python may be asked to run this)
        raise ImportError("Python 3.11 or later is needed, this is " + sys.version.split()[0])
    with open(os.path.join(resources, "slavemodule.txt"), encoding="utf-8") as file:
        name = file.read().strip()
    sys.path.insert(0, resources)
    try:
        entry = importlib.import_module(name)
    finally:
        sys.path.remove(resources)
    return importlib.import_module(entry.PACKAGE + ".fmi.server").Server(entry.Slave).answer


def serve(descriptor):  # type: ignore[no-untyped-def]
    """Answer requests until the socket closes."""
    with open(descriptor, "rb") as requests, open(os.dup(descriptor), "wb") as answers:

        def send(message):  # type: ignore[no-untyped-def]
            answers.write(len(message).to_bytes(4, sys.byteorder) + message)
            answers.flush()

        try:
            answer = load(os.path.dirname(os.path.abspath(__file__)))
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
