"""Forces of one sensor: ``calibrate gel`` and ``calibrate force`` of the command line."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from cmpdesign.api.layouts import reference_from
from cmpdesign.errors import CmpDesignError

if TYPE_CHECKING:
    from cmpdesign.contact.force_scale import ForceScale
    from cmpdesign.layout.layout import Layout as AnyLayout
    from extractor import LayoutLike
    from extractor.contact import Gel


def calibrate_gel(
    layout: LayoutLike | AnyLayout,
    rig: str | Path,
    output: str | Path | None = None,
    *,
    margin_mm: float = 0.0,
) -> Gel:
    """Make Green's matrix of a pad, with which forces are read, as the command ``calibrate gel`` does.

    >>> gel = cmpdesign.calibrate_gel("layout.json", "sensor.toml", "gel.npz")
    >>> reader = extractor.contact.ContactReader("layout.json", gel, young_mpa=0.3)

    Args:
        layout: the pad.
        rig: TOML file with an [elastomer]: ``thickness_mm``, ``poisson``, ``marker_depth_mm``.
        output: file to write: .npz; None: none.
        margin_mm: width of the gel beyond the layout's outline.

    Raises:
        CmpDesignError, extractor.ExtractorError: a file that cannot be read, or a value out of range.
        OutputError: the file cannot be written.
    """
    import io

    from cmpdesign.contact.finite_block import make_gel
    from cmpdesign.files.atomic import write_file
    from cmpdesign.tracking.marker_depth import read_elastomer

    if output is not None and Path(output).suffix.lower() != ".npz":
        raise CmpDesignError(f"{output}: unknown ending of a gel's file; expected .npz")
    gel = make_gel(reference_from(layout), read_elastomer(Path(rig)), margin_mm=margin_mm)
    if output is not None:
        stream = io.BytesIO()
        gel.write(stream)
        write_file(Path(output), stream.getvalue())
    return gel


def calibrate_force(run: str | Path, weights: str | Path) -> ForceScale:
    """Fit Young's modulus to known weights, as the command ``calibrate force`` does.

    >>> cmpdesign.calibrate_force("run.npz", "weights.csv").young_mpa

    Args:
        run: .npz file of ``reconstruct`` with ``contact``.
        weights: CSV file with the columns ``frame`` and ``mass_g``: the mass that stood on the pad in a frame.

    Raises:
        CmpDesignError: a file that cannot be read, a run without forces, or weights that do not determine the modulus.
    """
    import numpy as np

    from cmpdesign.api.sequences import load_run
    from cmpdesign.contact.force_scale import fit_force_scale, parse_weights
    from cmpdesign.files.npz import NpzError, read_npz
    from cmpdesign.inputs.files import read_text
    from extractor.contact import ContactReason

    load_run(run)
    names = ("frame", "contact_reason", "force_n", "force_cov_n2", "young_mpa")
    try:
        arrays = read_npz(run, *names)
    except NpzError:
        raise CmpDesignError(f"{run} holds no forces; write it with reconstruct --contact") from None
    known = parse_weights(read_text(Path(weights)), str(weights))
    missing = np.setdiff1d(known.frame, arrays["frame"])
    if len(missing):
        raise CmpDesignError(f"{weights}: frame {missing[0]} is not in {run}")
    at = np.searchsorted(arrays["frame"], known.frame)
    good = arrays["contact_reason"][at] == ContactReason.NONE
    force = np.where(good, -arrays["force_n"][at, 2], np.nan)
    return fit_force_scale(known, force, arrays["force_cov_n2"][at, 5], float(arrays["young_mpa"]))
