"""The elastic block of finite size: its outline has free walls, its support is rigid.

In: an outline, an elastomer, loads on the touched face, points below it. Out: the displacements that the walls change.
"""
