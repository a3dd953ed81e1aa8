"""The documents by the commands that print them, and their JSON Schemas."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Union

from pydantic import TypeAdapter

from cmpdesign.documents import calibration, data, designs, reading, runs
from cmpdesign.documents.document import Document, Message
from cmpdesign.errors import CmpDesignError
from cmpdesign.inputs.names import nearest_name

EXPERIMENTS = ("precision", "response", "reliability", "angles", "designs")
# The words of a command -> the documents that it prints; schema prints a JSON Schema itself.
DOCUMENTS: Mapping[str, tuple[type[Document], ...]] = {
    "templates": (designs.TemplatesDocument, designs.TemplateDocument),
    "init": (designs.InitDocument,),
    "size": (designs.SizeDocument,),
    "studio": (designs.StudioDocument,),
    "view": (designs.StudioDocument,),
    "build": (designs.BuildDocument,),
    "check": (designs.CheckDocument,),
    "render": (runs.RenderDocument,),
    "verify": (reading.VerifyDocument,),
    "cameras": (runs.CamerasDocument,),
    "track": (runs.TrackDocument, runs.RecoverDocument),
    "reconstruct": (runs.ReconstructDocument, runs.RecoverDocument),
    "serve": (runs.ServeDocument,),
    "dataset": (data.DatasetDocument, data.DatasetCheckDocument),
    "extract": (data.DatasetDocument,),
    "kerf": (reading.KerfDocument, reading.GridDocument),
    "calibrate camera": (calibration.CalibrateCameraDocument,),
    "calibrate check": (calibration.CalibrateCheckDocument,),
    "calibrate force": (reading.CalibrateForceDocument,),
    "calibrate gel": (reading.CalibrateGelDocument,),
    "calibrate pattern": (reading.CalibratePatternDocument,),
    "calibrate rig": (calibration.CalibrateRigDocument,),
    "export lerobot": (runs.ExportDocument,),
    "export zarr": (runs.ExportDocument,),
    **{f"evaluate {name}": (runs.EvaluateDocument,) for name in EXPERIMENTS},
    "message": (Message,),
}


def document_schema(command: str) -> dict[str, Any]:
    """The JSON Schema of what a command prints with ``--json``, or of "message".

    Raises:
        CmpDesignError: no such command.
    """
    models = DOCUMENTS.get(command)
    if models is None:
        known = ", ".join(DOCUMENTS)
        raise CmpDesignError(
            f"schema {command}: no command with a document of its own{nearest_name(command, DOCUMENTS)}; "
            f"there are {known}"
        )
    schema = TypeAdapter(Union[models]).json_schema()  # type: ignore[arg-type]  # noqa: UP007
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}
