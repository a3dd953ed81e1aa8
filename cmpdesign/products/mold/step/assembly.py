"""STEP AP242 assemblies: the entities of parts' files, renumbered. No solid is built again."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from cmpdesign.products.mold.step.entities import (
    SHARED_ENTITIES,
    StepEntities,
    StepProduct,
    Triple,
    add_context,
    add_product,
    data_section,
)


@dataclass(frozen=True)
class PartPlace:
    """The place of a part in an assembly: a half turn about the x axis (if ``turned``), then a translation.

    Attributes:
        part: name of the part.
        name: name of the place.
        xyz_mm: place of the part's origin.
        turned: the part lies upside down.
    """

    part: str
    name: str
    xyz_mm: tuple[float, float, float]
    turned: bool = False


@dataclass(frozen=True)
class Assembly:
    """A named group of places and of further groups."""

    name: str
    places: Sequence[PartPlace]
    groups: Sequence[Assembly] = ()


def assembly_to_step(assembly: Assembly, files: Mapping[str, bytes]) -> bytes:
    """Format the file of an assembly; each part is written once and placed as often as it is used.

    Args:
        assembly: places of the parts.
        files: part name -> bytes from ``solid_to_step``.
    """
    entities = StepEntities()
    products = {
        name: _add_part_entities(files[name], entities) for name in dict.fromkeys(_part_names(assembly))
    }
    _add_assembly(assembly, products, entities)
    return entities.to_bytes(assembly.name)


def _part_names(assembly: Assembly) -> list[str]:
    inner = [name for group in assembly.groups for name in _part_names(group)]
    return [place.part for place in assembly.places] + inner


def _add_part_entities(part: bytes, entities: StepEntities) -> StepProduct:
    """Add the entities of a part's file except the shared ones, numbered on from ``entities.last``."""
    text, shared = data_section(part), len(SHARED_ENTITIES)
    text = text[text.index(f"#{shared + 1} = ") :]
    shift = entities.last - shared
    last = int(text[text.rindex("\n#") + 2 :].partition(" ")[0])
    new = {str(number): f"#{number + shift}" for number in range(shared + 1, last + 1)}
    new |= {str(number): f"#{number}" for number in range(1, shared + 1)}
    pieces = re.split(r"#(\d+)", text)
    pieces[1::2] = [new[number] for number in pieces[1::2]]
    entities.add_numbered("".join(pieces), last + shift)
    return StepProduct.ending_at(entities.last)


def _add_assembly(
    assembly: Assembly, products: Mapping[str, StepProduct], entities: StepEntities
) -> StepProduct:
    members = [_Member(products[p.part], p.name, p.xyz_mm, p.turned) for p in assembly.places]
    for group in assembly.groups:
        members.append(_Member(_add_assembly(group, products, entities), group.name, (0.0, 0.0, 0.0), False))
    axes = [_add_axes(entities, member.xyz_mm, member.turned) for member in members]
    context = add_context(entities)
    own = add_product(assembly.name, "SHAPE_REPRESENTATION", axes, context, entities)
    for member, member_axes in zip(members, axes, strict=True):
        _add_usage(own, member.product, member.name, member_axes, entities)
    return own


class _Member(NamedTuple):
    """A product and its place in an assembly, see ``PartPlace``."""

    product: StepProduct
    name: str
    xyz_mm: Triple
    turned: bool


def _add_axes(entities: StepEntities, xyz_mm: Triple, turned: bool) -> int:
    return entities.add_axes(xyz_mm, (0.0, 0.0, -1.0 if turned else 1.0), (1.0, 0.0, 0.0))


def _add_usage(own: StepProduct, member: StepProduct, name: str, axes: int, entities: StepEntities) -> None:
    """Add the usage of a member, with the member's origin at ``axes``."""
    usage = entities.add(
        f"NEXT_ASSEMBLY_USAGE_OCCURRENCE('{entities.last + 1}','{name}','',"
        f"#{own.definition},#{member.definition},$)"
    )
    shape = entities.add(f"PRODUCT_DEFINITION_SHAPE('Placement','Placement of an item',#{usage})")
    transformation = entities.add(f"ITEM_DEFINED_TRANSFORMATION('','',#{member.origin},#{axes})")
    relation = entities.add(
        f"( REPRESENTATION_RELATIONSHIP('','',#{member.representation},#{own.representation}) "
        f"REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION(#{transformation}) "
        "SHAPE_REPRESENTATION_RELATIONSHIP() )"
    )
    entities.add(f"CONTEXT_DEPENDENT_SHAPE_REPRESENTATION(#{relation},#{shape})")
