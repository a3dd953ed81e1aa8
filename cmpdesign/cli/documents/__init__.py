"""The documents that commands print with ``--json``: one model each, from which the JSON Schema comes.

In: what a command found. Out: a checked document of stated format and version.
"""
