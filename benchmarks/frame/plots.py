"""Figures of matplotlib as PNG, the same bytes from the same data; matplotlib is imported with the first one."""

from __future__ import annotations

import io
from typing import Any


def pyplot() -> Any:
    """``matplotlib.pyplot``, which opens no window."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    return pyplot


def png_of(figure: Any) -> bytes:
    """PNG of a figure, which is closed."""
    data = io.BytesIO()
    figure.savefig(data, format="png", metadata={"Software": None})
    pyplot().close(figure)
    return data.getvalue()
