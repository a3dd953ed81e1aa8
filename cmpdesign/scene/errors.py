"""The error of a scene that cannot be drawn, and how strictly its parts are read from a file."""

from __future__ import annotations

from cmpdesign.errors import CmpDesignError


class SceneError(CmpDesignError, ValueError):
    """A scene whose values are out of range, or whose surface folds or turns away from the camera."""


# For pydantic, which reads the parts' tables: no unknown names, no texts for numbers, no NaN.
STRICT = {"extra": "forbid", "strict": True, "allow_inf_nan": False}
