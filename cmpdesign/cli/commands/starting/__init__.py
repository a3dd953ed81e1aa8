"""The commands with which a design begins: templates, a new file, the file's schema.

In: the arguments of a command line. Out: lists, a design file, a JSON Schema.
"""
