"""Displacements on pads whose markers are scattered: read with the nominal, with the learnt and with the true layout.

    python -m benchmarks.as_made [--quick] [--scatter-px S] [--pads N] [--seed S] [--json FILE]

Every marker of a pad is moved by a normal scatter, in px per axis at edges of 20 px. Twelve pictures of the pad at
rest, each in a different pose (any turn, tilts up to 25 degrees, edges of 18 to 21 px), give the learnt layout.
Other pictures show the pad at rest, and then pressed and twisted before a camera that has not moved. "position" is of
the markers in the picture of the contact, "displacement" is the difference of the two readings. The pictures are those
of the standard scene: 640 x 480 px, blur 1 px, sRGB, noise 2/255. "/ bound" is the RMS error over the exact Cramer-Rao
bound of free markers. z is the RMS error over the stated covariance per axis: 1 is right. The places are those of the
learnt layout, in um. All figures are pooled over patterns and pads; 95 % intervals are by bootstrap over pictures.
The default seed comes from the commit's hash.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from benchmarks.as_made.pads import (
    Errors,
    contact_errors,
    learn_pad,
    place_errors,
    reference_of,
    sample_contacts,
    sample_pad,
    shoot_contact,
)
from benchmarks.suites.camera.cases import commit_seed
from benchmarks.suites.scoring.calibration import Calibration, calibration_head, calibration_line, summarise
from benchmarks.suites.stress.frames import PATTERNS
from benchmarks.support.machine import conditions_text, write_json
from extractor.presets import PRESETS

SCATTER_PX = 0.2
REST_PICTURES = 12
PADS, CONTACTS = 2, 3  # a pattern; a pad
LAYOUTS = ("nominal", "learnt", "true")
KINDS = ("displacement", "position")
PLACES = "learnt places, um"
NAME_WIDTH = 34


@dataclass(frozen=True)
class Row:
    """Errors pooled over pictures.

    Attributes:
        name: what was measured, preset and layout.
        rms: root mean square error per axis, px (places: um).
        of_bound: over the bound; NaN for places.
        calibration: the errors over their stated covariances.
    """

    name: str
    rms: float
    of_bound: float
    calibration: Calibration


def measure(seed: int, scatter_px: float, pads: int, contacts: int) -> tuple[dict[str, list[Errors]], float]:
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
            for contact in sample_contacts(pad.made, contacts, rng):
                pictures = shoot_contact(contact)
                for preset in PRESETS:
                    for name, layout in zip(LAYOUTS, by_name, strict=True):
                        found = contact_errors(layout, preset, pictures)
                        errors[f"{KINDS[0]}: {preset}, {name}"].append(found.displacement)
                        errors[f"{KINDS[1]}: {preset}, {name}"].append(found.position)
    return errors, worst


def pooled_rows(errors: Mapping[str, Sequence[Errors]]) -> list[Row]:
    """One row a name."""
    rows = []
    for name, of_pictures in errors.items():
        error = np.concatenate([each.error for each in of_pictures])
        bound = np.concatenate([each.bound for each in of_pictures])
        rms = float(np.sqrt(np.nanmean(error**2)))
        of_bound = rms / float(np.sqrt(np.nanmean(bound))) if np.isfinite(bound).any() else float("nan")
        scale = 1e3 if name == PLACES else 1.0
        rows.append(Row(name, scale * rms, of_bound, summarise([each.squared for each in of_pictures])))
    return rows


def rows_text(rows: Sequence[Row]) -> str:
    """The table."""
    lines = [calibration_head("", NAME_WIDTH) + f"{'RMS':>10}{'/ bound':>10}"]
    for row in rows:
        ratio = f"{row.of_bound:.2f}" if np.isfinite(row.of_bound) else "-"
        lines.append(calibration_line(row.name, row.calibration, NAME_WIDTH) + f"{row.rms:>10.4f}{ratio:>10}")
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Measure, print the table, write the JSON file if asked."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.as_made", description=(__doc__ or "").split("\n")[0]
    )
    parser.add_argument("--quick", action="store_true", help="few pictures: a look, no figures to quote")
    parser.add_argument("--scatter-px", type=float, default=SCATTER_PX, metavar="S", help="per axis")
    parser.add_argument("--pads", type=int, default=PADS, metavar="N", help="of each pattern")
    parser.add_argument("--seed", type=int, metavar="S", help="of all random choices")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every row")
    options = parser.parse_args(arguments)
    started = time.perf_counter()
    try:
        seed = commit_seed() if options.seed is None else options.seed
    except ValueError as error:
        parser.error(str(error))
    if seed < 0 or options.scatter_px < 0 or options.pads < 1:
        parser.error("--seed and --scatter-px must be 0 or more, --pads 1 or more")
    pads, contacts = (1, 1) if options.quick else (options.pads, CONTACTS)
    errors, worst = measure(seed, options.scatter_px, pads, contacts)
    rows = pooled_rows(errors)
    print(rows_text(rows))
    print(
        f"scatter {options.scatter_px:g} px, seed {seed}; largest z of a rest picture {worst:.2f}; ", end=""
    )
    print(f"{time.perf_counter() - started:.0f} s")
    print(conditions_text())
    if options.json:
        write_json(
            options.json, {"seed": seed, "scatter_px": options.scatter_px, "rows": [asdict(r) for r in rows]}
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
