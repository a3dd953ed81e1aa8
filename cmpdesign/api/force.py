"""Forces of one sensor: ``calibrate gel`` and ``calibrate force`` of the command line."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cmpdesign.errors import CmpDesignError
from cmpdesign.inputs.files import require_suffix
from cmpdesign.inputs.options import Written

if TYPE_CHECKING:
    from cmpdesign.documents.reading import CalibrateForceDocument, CalibrateGelDocument
    from cmpdesign.layout.layout import Layout as AnyLayout
    from extractor import LayoutLike


def calibrate_gel(
    layout: LayoutLike | AnyLayout,
    rig: str | Path,
    output: Annotated[str | Path | None, Written(needed=True)] = None,
    *,
    margin_mm: Annotated[float, Written(metavar="MM")] = 0.0,
) -> CalibrateGelDocument:
    """Compute a pad's elastic response once, so that forces can be read from its displacement.

    >>> gel = cmpdesign.calibrate_gel("layout.json", "sensor.toml", "gel.npz").found
    >>> reader = extractor.contact.ContactReader("layout.json", gel, young_mpa=0.3)

    Args:
        layout: the pad's layout.json; or a layout, a ``Reference``, the JSON object of a layout file.
        rig: TOML file with [elastomer]: thickness_mm, poisson, marker_depth_mm.
        output: file to write: .npz; None: none.
        margin_mm: width of the gel beyond the layout's outline.

    Raises:
        CmpDesignError, extractor.ExtractorError: a file that cannot be read, or a value out of range.
        OutputError: the file cannot be written.
    """
    import io

    from cmpdesign.api.layouts import reference_from
    from cmpdesign.contact.finite_block import make_gel
    from cmpdesign.documents.reading import CalibrateGelDocument
    from cmpdesign.files.atomic import write_file
    from cmpdesign.tracking.marker_depth import read_elastomer

    require_suffix("output", output, ".npz")
    gel = make_gel(reference_from(layout), read_elastomer(Path(rig)), margin_mm=margin_mm)
    if output is not None:
        stream = io.BytesIO()
        gel.write(stream)
        write_file(Path(output), stream.getvalue())
    return CalibrateGelDocument.of(
        gel,
        written=str(output or ""),
        markers=len(gel.matrix) // 3,
        loads=len(gel.loads_mm),
    )


def calibrate_force(run: str | Path, weights: str | Path) -> CalibrateForceDocument:
    """Fit Young's modulus and the force at rest to known weights, best on a ball.

    >>> cmpdesign.calibrate_force("run.npz", "weights.csv").young_mpa

    Args:
        run: the .npz file of a reconstruction with contact.
        weights: CSV file, columns frame and mass_g: 3 or more different weights, each on the pad in its frame.

    Raises:
        CmpDesignError: a file that cannot be read, a run without forces, or weights that do not determine the modulus.
    """
    import numpy as np

    from cmpdesign.api.sequences import load_run
    from cmpdesign.contact.force_scale import fit_force_scale, parse_weights
    from cmpdesign.documents.reading import CalibrateForceDocument
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
    scale = fit_force_scale(known, force, arrays["force_cov_n2"][at, 5], float(arrays["young_mpa"]))
    return CalibrateForceDocument.of(scale)
