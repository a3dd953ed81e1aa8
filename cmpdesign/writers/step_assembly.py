"""STEP AP242 assemblies of parts' files: every part's entities are taken over as they were written, renumbered.

Nothing is translated again, so an assembly costs a copy of its parts' text.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

Direction = tuple[float, float, float]

# What every part's file begins with, in the translator's numbers: of these, the first two are shared.
_CONTEXT, _DEFINITION, _REPRESENTATION, _ORIGIN = 2, 5, 10, 11
_BEGINNING = {
    1: "APPLICATION_PROTOCOL_DEFINITION",
    _CONTEXT: "APPLICATION_CONTEXT",
    _DEFINITION: "PRODUCT_DEFINITION",
    _REPRESENTATION: "ADVANCED_BREP_SHAPE_REPRESENTATION",
    _ORIGIN: "AXIS2_PLACEMENT_3D",
}
_DATA, _END = b"DATA;\n", b"ENDSEC;\nEND-ISO-10303-21;"


@dataclass(frozen=True)
class Place:
    """A part's place in an assembly: first turned about the x axis (if ``turned``), then moved.

    Attributes:
        part: the part's name.
        name: the place's own.
        xyz_mm: where the part's origin comes to lie.
        turned: it lies upside down.
    """

    part: str
    name: str
    xyz_mm: tuple[float, float, float]
    turned: bool = False


@dataclass(frozen=True)
class Assembly:
    """A named group of places and further groups."""

    name: str
    places: Sequence[Place]
    groups: Sequence[Assembly] = ()


@dataclass(frozen=True)
class _Product:
    """Numbers of a product's definition, its shape's representation and the origin in it."""

    definition: int
    representation: int
    origin: int


def assembly_to_step(assembly: Assembly, files: Mapping[str, bytes]) -> bytes:
    """An assembly's file: each part once, placed as often as it is used.

    Args:
        assembly: what lies where.
        files: of each part's name, what ``solid_to_step`` wrote.
    """
    used = dict.fromkeys(_parts_of(assembly))
    first = next(iter(used))
    head = files[first].partition(_DATA)[0].replace(b"'%s.step'" % first.encode(), _file_name(assembly), 1)
    entities = _Entities(files[first])
    products = {name: entities.take_over(files[name]) for name in used}
    _add_assembly(assembly, products, entities)
    return b"".join([head, _DATA, *entities.texts, _END, b"\n"])


def _parts_of(assembly: Assembly) -> list[str]:
    inner = [name for group in assembly.groups for name in _parts_of(group)]
    return [place.part for place in assembly.places] + inner


def _file_name(assembly: Assembly) -> bytes:
    return f"'{assembly.name}.step'".encode()


class _Entities:
    """A file's entities, numbered one after the other."""

    def __init__(self, part: bytes) -> None:
        """Begin with the contexts that all parts share."""
        data = part.partition(_DATA)[2]
        self.texts = [data[: data.index(b"#%d = " % (_CONTEXT + 1))]]
        self.last = _CONTEXT

    def add(self, text: str) -> int:
        """An entity; its number."""
        self.last += 1
        self.texts.append(f"#{self.last} = {text};\n".encode())
        return self.last

    def take_over(self, part: bytes) -> _Product:
        """A part's entities but the shared ones."""
        data = part.partition(_DATA)[2].rpartition(_END)[0]
        for number, kind in _BEGINNING.items():
            if f"#{number} = {kind}(".encode() not in data:
                raise RuntimeError(f"STEP: #{number} of a part's file is no {kind}")
        data = data[data.index(b"#%d = " % (_CONTEXT + 1)) :]
        shift = self.last - _CONTEXT
        last = int(data[data.rindex(b"\n#") + 2 :].partition(b" ")[0])
        new = {b"%d" % number: b"#%d" % (number + shift) for number in range(_CONTEXT + 1, last + 1)}
        new |= {b"%d" % number: b"#%d" % number for number in range(1, _CONTEXT + 1)}
        pieces = re.split(rb"#(\d+)", data)
        pieces[1::2] = [new[number] for number in pieces[1::2]]
        self.texts.append(b"".join(pieces))
        self.last = last + shift
        return _Product(_DEFINITION + shift, _REPRESENTATION + shift, _ORIGIN + shift)


def _add_assembly(assembly: Assembly, products: Mapping[str, _Product], entities: _Entities) -> _Product:
    members = [(products[p.part], p.name, p.xyz_mm, p.turned) for p in assembly.places]
    for group in assembly.groups:
        members.append((_add_assembly(group, products, entities), group.name, (0.0, 0.0, 0.0), False))
    origin = _add_axes(entities, (0.0, 0.0, 0.0), turned=False)
    axes = [_add_axes(entities, xyz_mm, turned) for _, _, xyz_mm, turned in members]
    own = _add_product(assembly.name, origin, axes, entities)
    for (member, name, _, _), at in zip(members, axes, strict=True):
        _add_usage(own, member, name, at, entities)
    return own


def _add_axes(entities: _Entities, xyz_mm: tuple[float, float, float], turned: bool) -> int:
    point = entities.add(f"CARTESIAN_POINT('',({','.join(map(_real, xyz_mm))}))")
    up = entities.add(f"DIRECTION('',(0.,0.,{'-1.' if turned else '1.'}))")
    right = entities.add("DIRECTION('',(1.,0.,0.))")
    return entities.add(f"AXIS2_PLACEMENT_3D('',#{point},#{up},#{right})")


def _real(value: float) -> str:
    """As the translator writes it: twelve digits, always a point."""
    mantissa, _, exponent = f"{value:.12G}".partition("E")
    pointed = mantissa if "." in mantissa else f"{mantissa}."
    return f"{pointed}E{exponent}" if exponent else pointed


def _add_product(name: str, origin: int, axes: Sequence[int], entities: _Entities) -> _Product:
    context = _add_units(entities)
    items = ",".join(f"#{number}" for number in (origin, *axes))
    representation = entities.add(f"SHAPE_REPRESENTATION('',({items}),#{context})")
    of_product = entities.add(f"PRODUCT_CONTEXT('',#{_CONTEXT},'mechanical')")
    product = entities.add(f"PRODUCT('{name}','{name}','',(#{of_product}))")
    entities.add(f"PRODUCT_RELATED_PRODUCT_CATEGORY('part',$,(#{product}))")
    formation = entities.add(f"PRODUCT_DEFINITION_FORMATION('','',#{product})")
    view = entities.add(f"PRODUCT_DEFINITION_CONTEXT('part definition',#{_CONTEXT},'design')")
    definition = entities.add(f"PRODUCT_DEFINITION('design','',#{formation},#{view})")
    shape = entities.add(f"PRODUCT_DEFINITION_SHAPE('','',#{definition})")
    entities.add(f"SHAPE_DEFINITION_REPRESENTATION(#{shape},#{representation})")
    return _Product(definition, representation, origin)


def _add_units(entities: _Entities) -> int:
    length = entities.add("( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.) )")
    angle = entities.add("( NAMED_UNIT(*) PLANE_ANGLE_UNIT() SI_UNIT($,.RADIAN.) )")
    solid = entities.add("( NAMED_UNIT(*) SI_UNIT($,.STERADIAN.) SOLID_ANGLE_UNIT() )")
    uncertainty = entities.add(
        f"UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.E-07),#{length},"
        "'distance_accuracy_value','confusion accuracy')"
    )
    return entities.add(
        f"( GEOMETRIC_REPRESENTATION_CONTEXT(3) GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT((#{uncertainty})) "
        f"GLOBAL_UNIT_ASSIGNED_CONTEXT((#{length},#{angle},#{solid})) "
        "REPRESENTATION_CONTEXT('Context #1','3D Context with UNIT and UNCERTAINTY') )"
    )


def _add_usage(own: _Product, member: _Product, name: str, axes: int, entities: _Entities) -> None:
    """The member, its origin brought to ``axes``."""
    usage = entities.add(
        f"NEXT_ASSEMBLY_USAGE_OCCURRENCE('{entities.last + 1}','{name}','',"
        f"#{own.definition},#{member.definition},$)"
    )
    shape = entities.add(f"PRODUCT_DEFINITION_SHAPE('Placement','Placement of an item',#{usage})")
    move = entities.add(f"ITEM_DEFINED_TRANSFORMATION('','',#{member.origin},#{axes})")
    relation = entities.add(
        f"( REPRESENTATION_RELATIONSHIP('','',#{member.representation},#{own.representation}) "
        f"REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION(#{move}) SHAPE_REPRESENTATION_RELATIONSHIP() )"
    )
    entities.add(f"CONTEXT_DEPENDENT_SHAPE_REPRESENTATION(#{relation},#{shape})")
