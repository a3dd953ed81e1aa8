"""The bonded elastic layer: surface displacement from surface traction, and nearly back.

In: an ``Elastomer`` and a ``Grid``. Out: operators on tractions.
"""
