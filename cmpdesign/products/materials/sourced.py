"""A value with its source, as machines, materials and silicones state it."""

from __future__ import annotations

from typing import Annotated, Any, Generic, TypeVar

from pydantic import BaseModel, ConfigDict, Field

from cmpdesign.inputs.names import Line

Value = TypeVar("Value")


class StrictModel(BaseModel):
    """A frozen model that refuses unknown fields and infinite numbers."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Sourced(StrictModel, Generic[Value]):
    """A value with its source: a reference, a measurement, or "assumed"."""

    value: Value
    source: Annotated[Line, Field(min_length=3)]

    @property
    def mark(self) -> str:
        """The mark of an assumed value on a process sheet; else empty."""
        return " *" if self.source.startswith("assumed") else ""

    def stated(self, unit: str) -> str:
        """The number with its unit and mark."""
        return f"{self.value:g} {unit}{self.mark}"


def assumed(value: Any) -> Any:
    """The default of a field that a file leaves out."""
    return Sourced(value=value, source="assumed: the file leaves it out")
