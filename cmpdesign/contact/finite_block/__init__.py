"""The elastic block of finite size: its outline has free walls, its support is rigid.

In: a layout, an elastomer. Out: Green's matrix of the markers, for ``extractor.contact``.
"""

from __future__ import annotations

from cmpdesign.contact.finite_block.green_matrix import make_gel

__all__ = ["make_gel"]
