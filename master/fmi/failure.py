"""How a failure inside an FMU reaches the host, and the process survives it, and its own end.

PythonFMU knows three answers: OK, fmi2Discard (``do_step`` returns False) and, for a Python exception, fmi2Fatal. For
every exception it also releases the class, the instance and the log list once too often, so that the second one kills
the process. `Refused` is therefore raised through `refusal`, which takes those references beforehand; PythonFMU logs
its repr. FMI messages are printf formats, so '%' is doubled.
"""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

released_by_host = True  # PythonFMU does; the loader and `server` do not
LONGEST = 1000  # characters; hosts format messages in buffers of fixed size


class Refused(Exception):  # noqa: N818  (no error of the program: a message to the host)
    """Carries one line to the host."""

    def __repr__(self) -> str:
        return printable(str(self))


def printable(message: str) -> str:
    """One line, fit for a printf format."""
    return " ".join(message.split())[:LONGEST].replace("%", "%%")


def where(error: BaseException) -> str:
    """Type, text, file and line of an exception that nobody expected."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    place = f" ({Path(trace.tb_frame.f_code.co_filename).name}, line {trace.tb_lineno})" if trace else ""
    return f"{type(error).__name__}: {error}{place}"


def refusal(slave: Any, message: str) -> Refused:
    """The exception to raise out of a method of `slave` that PythonFMU calls."""
    for released in (type(slave), slave, slave.log_queue) if released_by_host else ():
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(released))
    return Refused(message)


def guarded(method: Callable[..., Any]) -> Callable[..., Any]:
    """Decorator for the methods that PythonFMU calls: nothing leaves them but a harmless `Refused`."""

    @functools.wraps(method)
    def call(slave: Any, *arguments: Any) -> Any:
        try:
            return method(slave, *arguments)
        except (Refused, ValueError) as error:
            raise refusal(slave, str(error)) from None
        except KeyboardInterrupt:
            raise refusal(slave, "interrupted") from None
        except Exception as error:  # a bug: say where it is, and let the host stop
            raise refusal(slave, where(error)) from None

    return call
