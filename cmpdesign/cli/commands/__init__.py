"""The commands, one file each. Commands parse, call and print.

In: the arguments of a command line. Out: files, lines, an exit code.
"""
