"""STEP AP242 assemblies of parts' files: every part's entities are taken over as they were written, renumbered.

Nothing is built again, so an assembly costs a copy of its parts' text.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from cmpdesign.products.mold.step.entities import (
    SHARED_ENTITIES,
    Direction,
    StepEntities,
    StepProduct,
    add_context,
    add_product,
    data_section,
)


@dataclass(frozen=True)
class PartPlace:
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
    places: Sequence[PartPlace]
    groups: Sequence[Assembly] = ()


def assembly_to_step(assembly: Assembly, files: Mapping[str, bytes]) -> bytes:
    """An assembly's file: each part once, placed as often as it is used.

    Args:
        assembly: what lies where.
        files: of each part's name, what ``solid_to_step`` wrote.
    """
    entities = StepEntities()
    products = {
        name: _add_part_entities(files[name], entities) for name in dict.fromkeys(_part_names(assembly))
    }
    _add_assembly(assembly, products, entities)
    return entities.file(assembly.name)


def _part_names(assembly: Assembly) -> list[str]:
    inner = [name for group in assembly.groups for name in _part_names(group)]
    return [place.part for place in assembly.places] + inner


def _add_part_entities(part: bytes, entities: StepEntities) -> StepProduct:
    """A part's entities but the shared ones, numbered on from the last one here."""
    text, shared = data_section(part), len(SHARED_ENTITIES)
    text = text[text.index(f"#{shared + 1} = ") :]
    shift = entities.last - shared
    last = int(text[text.rindex("\n#") + 2 :].partition(" ")[0])
    new = {str(number): f"#{number + shift}" for number in range(shared + 1, last + 1)}
    new |= {str(number): f"#{number}" for number in range(1, shared + 1)}
    pieces = re.split(r"#(\d+)", text)
    pieces[1::2] = [new[number] for number in pieces[1::2]]
    entities.take_over("".join(pieces), last + shift)
    return StepProduct.ending_at(entities.last)


def _add_assembly(
    assembly: Assembly, products: Mapping[str, StepProduct], entities: StepEntities
) -> StepProduct:
    members = [(products[p.part], p.name, p.xyz_mm, p.turned) for p in assembly.places]
    for group in assembly.groups:
        members.append((_add_assembly(group, products, entities), group.name, (0.0, 0.0, 0.0), False))
    axes = [_add_axes(entities, xyz_mm, turned) for _, _, xyz_mm, turned in members]
    context = add_context(entities)
    own = add_product(assembly.name, "SHAPE_REPRESENTATION", axes, context, entities)
    for (member, name, _, _), at in zip(members, axes, strict=True):
        _add_usage(own, member, name, at, entities)
    return own


def _add_axes(entities: StepEntities, xyz_mm: Direction, turned: bool) -> int:
    return entities.axes(xyz_mm, (0.0, 0.0, -1.0 if turned else 1.0), (1.0, 0.0, 0.0))


def _add_usage(own: StepProduct, member: StepProduct, name: str, axes: int, entities: StepEntities) -> None:
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
