"""The documents that commands print with ``--json``: one model for each; the JSON Schema is made from the model.

In: the result of a command. Out: a checked document of stated format and version.
"""
