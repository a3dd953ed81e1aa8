"""Displacements on pads whose markers are scattered: read with the nominal, with the learnt and with the true layout.

Every marker of a pad is moved by a normal scatter, in px per axis at edges of 20 px. Twelve pictures of the pad at
rest, each in a different pose (any turn, tilts up to 25 degrees, edges of 18 to 21 px), give the learnt layout.
Other pictures show the pad at rest, and then pressed and twisted before a camera that has not moved. "position" is of
the markers in the picture of the contact, "displacement" is the difference of the two readings. The pictures are those
of the standard scene: 640 x 480 px, blur 1 px, sRGB, noise 2/255. "/ bound" is the RMS error over the exact Cramer-Rao
bound of free markers. z is the RMS error over the stated covariance per axis: 1 is right. The places are those of the
learnt layout, in um. All figures are pooled over patterns and pads; 95 % intervals are by bootstrap over pictures.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from benchmarks.as_made.pads import (
    Errors,
    contact_errors,
    learn_pad,
    place_errors,
    reference_of,
    sample_contacts,
    sample_pad,
)
from benchmarks.frame.experiment import COMMIT, Experiment, OptionError, Shown
from benchmarks.frame.pooled import joined, rms_of
from benchmarks.frame.table import TEXT, Table
from benchmarks.suites.scoring.calibration import COLUMNS, calibration_values, summarise
from benchmarks.suites.stress.frames import PATTERNS
from extractor.presets import PRESETS

REST_PICTURES = 12
CONTACTS = 3  # a pad
LAYOUTS = ("nominal", "learnt", "true")
KINDS = ("displacement", "position")
PLACES = "learnt places, um"


def errors_by_row(
    seed: int, scatter_px: float, pads: int, contacts: int
) -> tuple[dict[str, list[Errors]], float]:
    """Errors by row, one entry a picture; the largest z of the residuals of a rest picture."""
    names = [f"{kind}: {preset}, {layout}" for kind in KINDS for preset in PRESETS for layout in LAYOUTS]
    errors: dict[str, list[Errors]] = {name: [] for name in (*names, PLACES)}
    worst = 0.0
    for number, pattern in enumerate(PATTERNS):
        for pad_number in range(pads):
            rng = np.random.default_rng([seed, number, pad_number])
            pad = sample_pad(pattern, scatter_px, REST_PICTURES, rng)
            learnt = learn_pad(pad)
            worst = max(worst, float(learnt.picture_z.max()))
            errors[PLACES].append(place_errors(pad, learnt))
            by_name = reference_of(pad.nominal), learnt.layout, reference_of(pad.made)
            for pictures in sample_contacts(pad.made, contacts, rng):
                for preset in PRESETS:
                    for name, layout in zip(LAYOUTS, by_name, strict=True):
                        for kind, found in contact_errors(layout, preset, pictures).items():
                            errors[f"{kind}: {preset}, {name}"].append(found)
    return errors, worst


def pooled_rows(errors: Mapping[str, Sequence[Errors]]) -> list[tuple[object, ...]]:
    """One row a name: RMS error per axis in px (places: um), over the bound, and errors over covariances."""
    rows = []
    for name, some in errors.items():
        rms, bound = rms_of(joined(some, "error")), rms_of(np.sqrt(joined(some, "bound")))
        stated = calibration_values(summarise([each.squared for each in some]))
        rows.append((name, (1e3 if name == PLACES else 1.0) * rms, rms / bound, *stated))
    return rows


def measure(quick: bool = False, scatter_px: float = 0.2, pads: int = 2, seed: int = COMMIT) -> Shown:
    """One row for what is measured by every preset and layout.

    Args:
        quick: few pictures.
        scatter_px: per axis.
        pads: of each pattern.
    """
    if scatter_px < 0:
        raise OptionError(f"--scatter-px is {scatter_px:g}; it must be 0 or more")
    errors, worst = errors_by_row(seed, scatter_px, *((1, 1) if quick else (pads, CONTACTS)))
    columns = {"": TEXT, "RMS": ".4f", "/ bound": ".2f"} | COLUMNS
    yield Table(f"scatter {scatter_px:g} px", columns, pooled_rows(errors))
    yield f"largest z of a rest picture {worst:.2f}"


main = Experiment("as_made", measure)
main.run_as(__name__)
