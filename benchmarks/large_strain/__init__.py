"""Errors of the shapes of linear contacts.

In: a ball that presses. Out: a table of its shapes compared with those of a neo-Hookean layer.
"""
