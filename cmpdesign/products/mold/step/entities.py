"""STEP files as text (ISO 10303-21, AP242): entities, numbers, and what every product of a file needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

# Files carry no date of their own: that of the format's edition stands for it.
_HEAD = """ISO-10303-21;
HEADER;
FILE_DESCRIPTION(('parts of a mold'),'2;1');
FILE_NAME('{name}.step','2014-12-01T00:00:00',(''),(''),'cmpdesign','cmpdesign','');
FILE_SCHEMA(('AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF {{1 0 10303 442 1 1 4 }}'));
ENDSEC;
DATA;
"""
_TAIL = "ENDSEC;\nEND-ISO-10303-21;\n"

# What every file begins with; all its products share it.
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
# References in a line of a long list.
_IN_A_LINE = 10

Direction = tuple[float, float, float]


@dataclass(frozen=True)
class StepProduct:
    """Numbers of a product's definition, its shape's representation and the origin in it."""

    definition: int
    representation: int
    origin: int

    @classmethod
    def ending_at(cls, last: int) -> StepProduct:
        """The one whose last entity is this: what ``add_product`` adds is always as many."""
        return cls(last - 2, last - 8, last - 9)


class StepEntities:
    """A file's entities, numbered one after the other from 1; the first are ``SHARED_ENTITIES``."""

    def __init__(self) -> None:
        self.last = 0
        self._texts: list[str] = []
        self._known: dict[str, int] = {}
        for text in SHARED_ENTITIES:
            self.add(text)

    def add(self, text: str) -> int:
        """An entity; its number."""
        self.last += 1
        self._texts.append(f"#{self.last} = {text};\n")
        return self.last

    def share(self, text: str) -> int:
        """The number of an entity that may stand for many: it is written once."""
        number = self._known.get(text)
        if number is None:
            number = self._known[text] = self.add(text)
        return number

    def take_over(self, text: str, last: int) -> None:
        """Entities that are numbered already, up to ``last``."""
        self._texts.append(text)
        self.last = last

    def point(self, x: float, y: float, z: float) -> int:
        return self.share(f"CARTESIAN_POINT('',({format_real(x)},{format_real(y)},{format_real(z)}))")

    def direction(self, x: float, y: float, z: float) -> int:
        return self.share(f"DIRECTION('',({format_real(x)},{format_real(y)},{format_real(z)}))")

    def axes(self, point: Direction, z: Direction, x: Direction) -> int:
        """A place, its z and its x axis."""
        at, up, right = self.point(*point), self.direction(*z), self.direction(*x)
        return self.add(f"AXIS2_PLACEMENT_3D('',#{at},#{up},#{right})")

    def file(self, name: str) -> bytes:
        """The file that holds them."""
        return "".join([_HEAD.format(name=name), *self._texts, _TAIL]).encode("ascii")


def data_section(file: bytes) -> str:
    """The entities of a file that ``StepEntities.file`` wrote."""
    return file.decode("ascii").partition("\nDATA;\n")[2].removesuffix(_TAIL)


def format_real(value: float) -> str:
    """Twelve digits, always a point; a zero has no sign."""
    text = f"{value:.12G}"
    if "E" in text:
        mantissa, _, exponent = text.partition("E")
        return f"{mantissa}E{exponent}" if "." in mantissa else f"{mantissa}.E{exponent}"
    if "." in text:
        return text
    return "0." if text == "-0" else f"{text}."


def format_references(numbers: Sequence[int]) -> str:
    """A list of entities, in lines of a moderate length."""
    lines = (numbers[start : start + _IN_A_LINE] for start in range(0, len(numbers), _IN_A_LINE))
    return ",\n".join(",".join(f"#{number}" for number in line) for line in lines)


def add_context(entities: StepEntities) -> int:
    """A space of its own for one product's shape, in mm."""
    return entities.add(
        f"( GEOMETRIC_REPRESENTATION_CONTEXT(3) GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT((#{_UNCERTAINTY})) "
        f"GLOBAL_UNIT_ASSIGNED_CONTEXT((#{_LENGTH},#{_ANGLE},#{_SOLID_ANGLE})) "
        "REPRESENTATION_CONTEXT('Context #1','3D Context with UNIT and UNCERTAINTY') )"
    )


def add_product(
    name: str, kind: str, items: Sequence[int], context: int, entities: StepEntities
) -> StepProduct:
    """A product whose shape is a representation of ``kind`` of these items and of its own origin."""
    origin = entities.axes((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
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
