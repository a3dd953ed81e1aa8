"""From a design to its layout: sizes, positions, checks and key figures. This room knows no file format.

In: a ``Design``. Out: a frozen ``Layout``, findings, a ``DesignReport``.
"""
