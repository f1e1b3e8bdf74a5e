"""Fixtures of the tests of the command line."""

from still_drive import still

__all__ = ["still"]
