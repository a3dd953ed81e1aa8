"""The command line: it parses, calls and prints; one file a command; nothing heavy until one runs."""

from __future__ import annotations

from cmpdesign.cli.app import app, main

__all__ = ["app", "main"]
