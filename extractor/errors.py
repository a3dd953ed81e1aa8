"""The errors that the extractor raises on purpose. A poor image is not an error: see ``result.Reason``."""

from __future__ import annotations


class ExtractorError(Exception):
    """Base of the extractor's errors; the message is one line."""


class LayoutError(ExtractorError, ValueError):
    """A layout file that cannot be read or contradicts itself; names file, field, value and expectation."""


class ImageError(ExtractorError, ValueError):
    """An image whose type, shape or size cannot be read as a color picture."""


class RigError(ExtractorError, ValueError):
    """A rig file or a view that contradicts itself; names file, field, value and expectation."""


class PoseError(ExtractorError, ValueError):
    """Views whose poses cannot be estimated, or give no positions in space; names the views and the cause."""


class RestError(ExtractorError, ValueError):
    """Rest pictures from which no places can be learnt; names the picture, the value, the limit and the remedy."""


class GelError(ExtractorError, ValueError):
    """A gel's file that cannot be read or belongs to another pad; an elastomer without a modulus."""
