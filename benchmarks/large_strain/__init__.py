"""How far shapes of linear contacts may be believed.

In: a ball that presses. Out: a table of its shapes beside those of a neo-Hookean layer.
"""
