"""How a failure inside an FMU reaches the host: as a line of its log, see `server`. These are printf formats, so '%' is doubled."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

LONGEST = 1000  # characters; hosts format messages in buffers of fixed size


class Refused(Exception):  # noqa: N818  (no error of the program: a message to the host)
    """Carries one line to the host."""


def visible(text: str, kept: str = "") -> str:
    """The text with everything escaped that a screen would obey, turn round or not show, but for the characters `kept`."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in kept else c.encode("unicode_escape").decode() for c in text)


def printable(message: str) -> str:
    """One line, fit for a printf format."""
    return visible(" ".join(message.split()))[:LONGEST].replace("%", "%%")


def where(error: BaseException) -> str:
    """Type, text, file and line of an exception that nobody expected."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    place = f" ({Path(trace.tb_frame.f_code.co_filename).name}, line {trace.tb_lineno})" if trace else ""
    return f"{type(error).__name__}: {error}{place}"


def guarded(method: Callable[..., Any]) -> Callable[..., Any]:
    """Decorator for the methods that `server` calls: nothing leaves them but a harmless `Refused`."""

    @functools.wraps(method)
    def call(slave: Any, *arguments: Any) -> Any:
        try:
            return method(slave, *arguments)
        except (Refused, ValueError) as error:
            raise Refused(str(error)) from None
        except KeyboardInterrupt:
            raise Refused("interrupted") from None
        except Exception as error:  # a bug: say where it is, and let the host stop
            raise Refused(where(error)) from None

    return call
