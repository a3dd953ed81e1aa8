"""Silicones: TOML files with shrinkage, cure and inhibiting materials, each value with its source."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, ValidationError

from cmpdesign.design.mold_options import Tool
from cmpdesign.design.templates import templates_folder
from cmpdesign.errors import DesignError, InputError
from cmpdesign.inputs.documents import read_toml
from cmpdesign.inputs.files import path_exists
from cmpdesign.inputs.names import Line, Name, nearest_name
from cmpdesign.inputs.validation import validation_message
from cmpdesign.products.materials.sourced import Sourced, StrictModel, assumed

Share = Annotated[float, Field(ge=0, lt=10)]
Positive = Annotated[float, Field(gt=0, le=1e6)]
Loss = Annotated[float, Field(ge=0, le=500)]
Celsius = Annotated[float, Field(gt=23, le=300)]


class Silicone(StrictModel):
    """A casting silicone.

    Attributes:
        name: name of the product.
        cure: the chemistry; tin and platinum silicones do not cure against each other.
        shrinkage_percent: linear shrinkage after full cure.
        density_g_cm3, pot_life_min, cure_h: values at room temperature, for the process sheet.
        parts_a_b: masses of A and B that are mixed, in any unit.
        pigment_percent: mass of pigment paste over that of A and B, where a layer has a color.
        retarder_percent, thickener_percent: the same for the black layer, which must stay a dough while it is embossed.
        loss_percent: silicone that stays in cups and syringes, over what is cast.
        degas_min: time under vacuum after mixing.
        warm_cure: pairs of a temperature in degrees Celsius and the hours of cure at it; empty: unknown.
        inhibited_by: materials of parts on which the silicone's surface stays sticky.
        remedy: remedy against the inhibition.
        clear: the camera can see through a base layer of this silicone; None: unknown.
    """

    name: Name
    cure: Literal["platinum", "tin"]
    shrinkage_percent: Sourced[Share]
    density_g_cm3: Sourced[Positive]
    pot_life_min: Sourced[Positive]
    cure_h: Sourced[Positive]
    inhibited_by: Sourced[tuple[Tool, ...]]
    remedy: Line
    clear: Sourced[bool] | None = None
    parts_a_b: Sourced[tuple[Positive, Positive]] = assumed((1.0, 1.0))
    pigment_percent: Sourced[Share] = assumed(2.0)
    retarder_percent: Sourced[Share] = assumed(1.0)
    thickener_percent: Sourced[Share] = assumed(2.0)
    loss_percent: Sourced[Loss] = assumed(30.0)
    degas_min: Sourced[Positive] = assumed(3.0)
    warm_cure: Sourced[tuple[tuple[Celsius, Positive], ...]] = assumed(())

    @property
    def scale(self) -> float:
        """Size of the mold over size of the cured silicone: 1 / (1 - shrinkage)."""
        return 1 / (1 - self.shrinkage_percent.value / 100)


def silicones() -> dict[str, Path]:
    """The TOML file of every silicone template, by name."""
    return {path.stem: path for path in sorted((templates_folder() / "silicones").glob("*.toml"))}


def load_silicone(name_or_path: str, user: str = "mold") -> Silicone:
    """Load a silicone template by name, or a silicone from a TOML file; errors begin with ``user``, which names it.

    Raises:
        DesignError: unknown silicone, or a file that does not describe a silicone.
    """
    known = silicones()
    path = known.get(name_or_path, Path(name_or_path))
    if not path_exists(path):
        raise DesignError(
            f"{user}: {name_or_path!r} is no silicone{nearest_name(name_or_path, known)}; there are "
            f"{', '.join(known)}, or give a TOML file"
        )
    try:
        return Silicone.model_validate(read_toml(path))
    except InputError as error:
        raise DesignError(f"{user}: {error}") from None
    except ValidationError as error:
        raise DesignError(f"{user}: {path}: {validation_message(error, Silicone)}") from None
