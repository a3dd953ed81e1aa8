"""The commands with which work begins: templates, a new file, the file's schema, the cameras that there are.

In: the arguments of a command line. Out: lists, a design file, a JSON Schema.
"""
