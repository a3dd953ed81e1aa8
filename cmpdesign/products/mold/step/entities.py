"""STEP files as text (ISO 10303-21, AP242): entities, numbers, and the entities of a product."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

# The date in a file is that of the format's edition, so that files do not depend on the date of writing.
_HEAD = """ISO-10303-21;
HEADER;
FILE_DESCRIPTION(('parts of a mold'),'2;1');
FILE_NAME('{name}.step','2014-12-01T00:00:00',(''),(''),'cmpdesign','cmpdesign','');
FILE_SCHEMA(('AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF {{1 0 10303 442 1 1 4 }}'));
ENDSEC;
DATA;
"""
_TAIL = "ENDSEC;\nEND-ISO-10303-21;\n"

# The first entities of every file; all products of the file share them.
CONTEXT, _LENGTH, _ANGLE, _SOLID_ANGLE, _UNCERTAINTY = 2, 3, 4, 5, 6
SHARED_ENTITIES = (
    f"APPLICATION_PROTOCOL_DEFINITION('international standard',"
    f"'ap242_managed_model_based_3d_engineering',2013,#{CONTEXT})",
    "APPLICATION_CONTEXT('Managed model based 3d engineering')",
    "( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.) )",
    "( NAMED_UNIT(*) PLANE_ANGLE_UNIT() SI_UNIT($,.RADIAN.) )",
    "( NAMED_UNIT(*) SI_UNIT($,.STERADIAN.) SOLID_ANGLE_UNIT() )",
    f"UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.E-07),#{_LENGTH},"
    "'distance_accuracy_value','confusion accuracy')",
)
# References per line of a long list.
_IN_A_LINE = 10

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class StepProduct:
    """Numbers of a product's definition, of its shape's representation and of the origin in the representation."""

    definition: int
    representation: int
    origin: int

    @classmethod
    def ending_at(cls, last: int) -> StepProduct:
        """The product whose last entity has the number ``last``; ``add_product`` adds a fixed number of entities."""
        return cls(last - 2, last - 8, last - 9)


class StepEntities:
    """The entities of a file, numbered from 1; the first are ``SHARED_ENTITIES``."""

    def __init__(self) -> None:
        self.last = 0
        self._texts: list[str] = []
        self._known: dict[str, int] = {}
        for text in SHARED_ENTITIES:
            self.add(text)

    def add(self, text: str) -> int:
        """Add an entity; its number."""
        self.last += 1
        self._texts.append(f"#{self.last} = {text};\n")
        return self.last

    def add_shared(self, text: str) -> int:
        """Add an entity unless an equal entity exists; its number."""
        number = self._known.get(text)
        if number is None:
            number = self._known[text] = self.add(text)
        return number

    def add_numbered(self, text: str, last: int) -> None:
        """Add the text of entities that are numbered already, up to ``last``."""
        self._texts.append(text)
        self.last = last

    def add_point(self, x: float, y: float, z: float) -> int:
        return self.add_shared(f"CARTESIAN_POINT('',({format_real(x)},{format_real(y)},{format_real(z)}))")

    def add_direction(self, x: float, y: float, z: float) -> int:
        return self.add_shared(f"DIRECTION('',({format_real(x)},{format_real(y)},{format_real(z)}))")

    def add_axes(self, origin: Triple, z: Triple, x: Triple) -> int:
        """Add axes with an origin (mm), a z and an x direction; their number."""
        numbers = self.add_point(*origin), self.add_direction(*z), self.add_direction(*x)
        return self.add(f"AXIS2_PLACEMENT_3D('',#{numbers[0]},#{numbers[1]},#{numbers[2]})")

    def to_bytes(self, name: str) -> bytes:
        """The bytes of the file with all entities."""
        return "".join([_HEAD.format(name=name), *self._texts, _TAIL]).encode("ascii")


def data_section(file: bytes) -> str:
    """The text of the entities of a file from ``StepEntities.to_bytes``."""
    return file.decode("ascii").partition("\nDATA;\n")[2].removesuffix(_TAIL)


def format_real(value: float) -> str:
    """Format a number with twelve digits and always a point; a zero has no sign."""
    text = f"{value:.12G}"
    if "E" in text:
        mantissa, _, exponent = text.partition("E")
        return f"{mantissa}E{exponent}" if "." in mantissa else f"{mantissa}.E{exponent}"
    if "." in text:
        return text
    return "0." if text == "-0" else f"{text}."


def format_references(numbers: Sequence[int]) -> str:
    """Format a list of references to entities, in lines of ``_IN_A_LINE``."""
    lines = (numbers[start : start + _IN_A_LINE] for start in range(0, len(numbers), _IN_A_LINE))
    return ",\n".join(",".join(f"#{number}" for number in line) for line in lines)


def add_context(entities: StepEntities) -> int:
    """Add a geometric context for one product's shape, in mm; its number."""
    return entities.add(
        f"( GEOMETRIC_REPRESENTATION_CONTEXT(3) GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT((#{_UNCERTAINTY})) "
        f"GLOBAL_UNIT_ASSIGNED_CONTEXT((#{_LENGTH},#{_ANGLE},#{_SOLID_ANGLE})) "
        "REPRESENTATION_CONTEXT('Context #1','3D Context with UNIT and UNCERTAINTY') )"
    )


def add_product(
    name: str, kind: str, items: Sequence[int], context: int, entities: StepEntities
) -> StepProduct:
    """Add a product whose shape is a representation of ``kind`` of the items and of an origin."""
    origin = entities.add_axes((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
    representation = entities.add(f"{kind}('',({format_references((origin, *items))}),#{context})")
    of_product = entities.add(f"PRODUCT_CONTEXT('',#{CONTEXT},'mechanical')")
    product = entities.add(f"PRODUCT('{name}','{name}','',(#{of_product}))")
    entities.add(f"PRODUCT_RELATED_PRODUCT_CATEGORY('part',$,(#{product}))")
    formation = entities.add(f"PRODUCT_DEFINITION_FORMATION('','',#{product})")
    view = entities.add(f"PRODUCT_DEFINITION_CONTEXT('part definition',#{CONTEXT},'design')")
    definition = entities.add(f"PRODUCT_DEFINITION('design','',#{formation},#{view})")
    shape = entities.add(f"PRODUCT_DEFINITION_SHAPE('','',#{definition})")
    entities.add(f"SHAPE_DEFINITION_REPRESENTATION(#{shape},#{representation})")
    added = StepProduct(definition, representation, origin)
    assert added == StepProduct.ending_at(entities.last)
    return added
