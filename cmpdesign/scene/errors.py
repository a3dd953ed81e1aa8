"""The error of a scene that cannot be drawn, and the strictness of tables in scene files."""

from __future__ import annotations

from cmpdesign.errors import CmpDesignError


class SceneError(CmpDesignError, ValueError):
    """A value of a scene is out of range, or its surface folds or turns away from the camera."""


# Configuration of pydantic for the parts' tables: no unknown names, no texts for numbers, no NaN.
STRICT = {"extra": "forbid", "strict": True, "allow_inf_nan": False}
