"""The commands with which a design begins: what is shipped, a new file, the file's schema.

In: the arguments of a command line. Out: lists, a design file, a JSON Schema.
"""
