"""The commands, one file each. They parse, call and print.

In: the words of a command line. Out: files, lines, an exit code.
"""
