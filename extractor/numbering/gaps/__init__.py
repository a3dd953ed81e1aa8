"""Numbers detached cells, behind a scratch or amid missing cells, by contact or by prediction and color.

In: numbered cells, cells without a number. Out: more numbered cells, without inconsistent ones.
"""
