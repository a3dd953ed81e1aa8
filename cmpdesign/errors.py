"""Errors for users. Every message names the value, the limit, the unit and the remedy."""

from __future__ import annotations


class CmpDesignError(Exception):
    """Base of every error that cmpdesign raises on purpose; the command line prints it on one line."""


class DesignError(CmpDesignError, ValueError):
    """A design whose parameters are unknown, out of range or contradict each other."""


class InputError(CmpDesignError, ValueError):
    """A file that cannot be read, is no document of its format, or exceeds a limit."""


class OutputError(CmpDesignError, OSError):
    """A file or folder that could not be written. Its previous content is unchanged."""
