"""The base of all documents, and the message that stands for an error or a warning."""

from __future__ import annotations

from typing import Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, PrivateAttr


class DocumentPart(BaseModel):
    """An object within a document. Unknown fields and values that are not finite are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


def _require_format(schema: dict[str, Any]) -> None:
    schema["required"] = ["format", "version", *schema.get("required", [])]


class Document(DocumentPart):
    """The record that a call returns and that its command prints with ``--json``.

    A document has the fields ``format`` and ``version``. The version rises when a field is removed or changes its
    meaning or type; a new field does not raise the version.
    """

    model_config = ConfigDict(json_schema_extra=_require_format)
    _found: Any = PrivateAttr(None)

    @classmethod
    def of(cls, found: object, **fields: Any) -> Self:
        """The document of a value that may be more than a document can hold, as arrays.

        Required fields that are not given are the value's attributes of the same names, and so are those of its parts.
        """
        required = [name for name, field in cls.model_fields.items() if field.is_required()]
        own = {name: getattr(found, name) for name in required if name not in fields}
        made = cls.model_validate(own | fields, from_attributes=True)
        made._found = found
        return made

    @property
    def found(self) -> Any:
        """The value behind the figures, as the call states; None where the figures are all."""
        return self._found

    def to_json(self) -> str:
        """The text of the document."""
        return self.model_dump_json(indent=2) + "\n"


class Message(Document):
    """One line on stderr with ``--json``."""

    format: Literal["cmp-message"] = "cmp-message"
    version: Literal[1] = 1
    level: Literal["error", "warning", "step"] = Field(description="step: a finished step, with --verbose.")
    text: str
    exit_code: int | None = Field(
        None, description="Exit code of an error: 2 bad input, 130 stopped by Ctrl-C."
    )
