"""A design: the parameters from which all other values are derived, with units and templates.

In: a template's name or a TOML file, and overrides. Out: a frozen, validated ``Design``.
"""
