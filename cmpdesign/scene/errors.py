"""The error of a scene that cannot be drawn."""

from __future__ import annotations

from cmpdesign.errors import CmpDesignError


class SceneError(CmpDesignError, ValueError):
    """A scene whose values are out of range, or whose surface folds or turns away from the camera."""
