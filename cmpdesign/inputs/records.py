"""Documents that this project writes and reads back: one schema each, strict, so that an edited file is one line."""

from __future__ import annotations

from typing import Annotated, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from cmpdesign.errors import InputError
from cmpdesign.inputs.documents import parse_json
from cmpdesign.inputs.validation import validation_message

Digest = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]  # SHA-256
MAX_COUNT = 1 << 60


class Record(BaseModel):
    """Base of the schemas: no unknown field, no other type, no NaN, and nothing changes afterwards."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


R = TypeVar("R", bound=Record)


def parse_record(text: str, name: str, kind: type[R]) -> R:
    """The record in a JSON text; ``name`` is the prefix of every error's message.

    Raises:
        InputError: no JSON, or not of the schema; one line.
    """
    return checked_record(parse_json(text, name), name, kind)


def checked_record(document: object, name: str, kind: type[R]) -> R:
    """The record in a JSON value; errors as for ``parse_record``."""
    try:
        return kind.model_validate(document)
    except ValidationError as error:
        raise InputError(f"{name}: {validation_message(error, kind)}") from None
