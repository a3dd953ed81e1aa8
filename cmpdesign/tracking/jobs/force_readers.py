"""Readers of forces, made of a gel and a sensor file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from cmpdesign.errors import CmpDesignError

if TYPE_CHECKING:
    from extractor import ContactTracker, Markers, Reference, Tracker
    from extractor.contact import ContactReader


def contact_reader(gel: Path, rig: Path, layout: Reference) -> ContactReader:
    """The reader of forces by a file of ``calibrate gel`` and the [elastomer] of a sensor file.

    Raises:
        CmpDesignError, extractor.GelError: a file that cannot be used, or another pad's.
    """
    from cmpdesign.tracking.marker_depth import read_force_constants
    from extractor.contact import ContactReader, load_gel

    scale = read_force_constants(rig)
    return ContactReader(
        layout,
        load_gel(gel),
        scale.young_mpa,
        young_sigma_mpa=scale.young_sigma_mpa,
        friction=scale.friction,
    )


def contact_tracker(
    tracker: Tracker, rig: Path, contact: ContactReader, rest: Markers | None
) -> ContactTracker:
    """A tracker of the rig's only view that also reads forces.

    Raises:
        CmpDesignError: several views, or one of a part of the image.
    """
    from extractor import ContactTracker, load_rig

    views = load_rig(rig).views
    if len(views) != 1 or views[0].area_px is not None:
        raise CmpDesignError(
            f"{rig} has {len(views)} views; force from one camera needs one [[view]] of the whole image: take "
            "reconstruct for several views"
        )
    return ContactTracker(tracker, views[0], contact, rest)
