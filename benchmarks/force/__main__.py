"""``python -m benchmarks.force``: force, torque and centre of the finite-element frames, as the reader finds them."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
from rich.table import Table

from benchmarks.force.truth import FRICTION, TRUTH, YOUNG_MPA, cases
from benchmarks.support.command import wide_console
from cmpdesign.contact import Elastomer
from cmpdesign.contact.finite_block import make_gel
from cmpdesign.design.design import load_design
from cmpdesign.layout.build import build_layout
from extractor.contact import ContactReader

SIGMA_MM = np.array([0.001, 0.001, 0.003])
DEPTH_PLACE, DEPTH_MM = 1, 0.5  # of ``DEPTHS_MM``


def main() -> int:
    """Print one row for every frame: markers 0.5 mm deep, noise of 1, 1 and 3 um."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--truth", type=Path, default=TRUTH, help="file of `python -m benchmarks.force.truth`"
    )
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    with np.load(args.truth) as file:
        truth = dict(file)
    layout = build_layout(load_design("honeycomb"))
    cov = np.tile(np.diag(SIGMA_MM**2), (len(layout.marker_xy_mm), 1, 1))
    random = np.random.default_rng(args.seed)
    table = Table(
        "contact", "Fz, N", "error", "z", "shear error / Fz", "torque z", "centre, um", "cold ms", "warm ms"
    )
    errors = []
    for case in cases():
        mine = np.flatnonzero(truth["case"] == case.name)
        if not len(mine):
            continue
        layer = Elastomer(case.thickness_mm, YOUNG_MPA, case.poisson, DEPTH_MM)
        reader = ContactReader(layout, make_gel(layout, layer), YOUNG_MPA, friction=FRICTION)
        for frame in mine:
            moved = truth["displacement_mm"][frame, DEPTH_PLACE] + SIGMA_MM * random.normal(
                size=(len(cov), 3)
            )
            times = []
            for cold in (True, False):
                if cold:
                    reader.reset()
                start = time.process_time()
                found = reader.read(moved, cov)
                times.append(1e3 * (time.process_time() - start))
            force = truth["force_n"][frame]
            error = found.force_n - force
            relative = error[2] / force[2]
            errors.append(relative)
            torque = found.torque_nmm - truth["torque_nmm"][frame]
            z = torque / np.sqrt(np.diag(found.torque_cov_nmm2))
            centre = found.regions[0].centre_mm if found.regions else np.full(2, np.nan)
            off = np.hypot(*(centre - truth["centre_mm"][frame]).T).min()
            table.add_row(
                case.name,
                f"{-force[2]:.3f}",
                f"{relative:+.1%}",
                f"{error[2] / np.sqrt(found.force_cov_n2[2, 2]):+.1f}",
                f"{np.hypot(*error[:2]) / -force[2]:.1%}",
                f"{np.sqrt((z**2).mean()):.1f}",
                f"{1e3 * off:.0f}",
                *(f"{value:.1f}" for value in times),
            )
    console = wide_console()
    console.print(table)
    console.print(f"Fz: rms {np.sqrt(np.mean(np.square(errors))):.1%}, worst {np.abs(errors).max():.1%}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
