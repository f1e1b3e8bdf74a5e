"""What an FMU says in its log."""

from __future__ import annotations

from collections import deque
from typing import Any

import fmpy
from fmpy import fmi2

_KEPT = 20

Messages = deque[tuple[int, str]]  # status and text


def log() -> Messages:
    """An empty log, which keeps the latest messages."""
    return deque(maxlen=_KEPT)


def spoken(messages: Messages) -> list[str]:
    """The latest warnings and complaints; forgets them."""
    texts = [text for status, text in messages if status > 0]
    messages.clear()
    return texts


def last_words(messages: Messages, otherwise: str) -> str:
    """The latest warning or complaint; forgets it."""
    return (spoken(messages) or [otherwise])[-1]


def callbacks(messages: Messages) -> Any:
    """Callbacks of an FMU that put what it logs into `messages`.

    FMPy's proxy, which fills in printf arguments, keeps one logger a process: with it all messages would reach the last
    instance. Without it messages are seen as formats, and '%%' is the only directive undone here.
    """

    def note(environment: Any, instance: bytes, status: int, category: bytes, message: bytes) -> None:
        lines = message.decode("utf-8", "replace").replace("%%", "%").split("\n")
        messages.append((status, lines[-1].strip()))  # PythonFMU puts a line of its own before a failure's text

    found = fmi2.fmi2CallbackFunctions()
    found.logger = fmi2.fmi2CallbackLoggerTYPE(note)
    found.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
    found.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
    return found
