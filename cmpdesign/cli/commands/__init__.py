"""The commands: each is a call, whose record is printed for people.

In: the arguments of a command line. Out: files, lines, an exit code.
"""
