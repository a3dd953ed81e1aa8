"""Compatibility with version 0.1: ``from cmpdesign.writers.layout_file import layout_to_json``."""

from __future__ import annotations

from cmpdesign.files.layout_json import layout_to_json as layout_to_json
from cmpdesign.files.layout_json import write_layout as write_layout
