"""The commands that open the page in the browser.

In: the arguments of a command line. Out: a server on this machine, until Ctrl-C.
"""
