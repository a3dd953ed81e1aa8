"""A design: the parameters from which all else is derived, with their units and templates.

In: a template's name or a TOML file, and overrides. Out: a frozen, validated ``Design``.
"""
