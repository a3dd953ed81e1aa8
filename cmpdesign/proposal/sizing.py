"""``size``: a design for a camera and its field of view."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cmpdesign.inputs.files import require_suffix
from cmpdesign.inputs.options import Make, Written

if TYPE_CHECKING:
    from cmpdesign.proposal.camera_design import Proposal


def size(
    camera: Annotated[str | tuple[int, int], Written(name="--camera", metavar="WxH")],
    view: Annotated[str | tuple[float, float], Written(name="--view", metavar="WxH")],
    error: Annotated[str | float | None, Written(metavar="LENGTH")] = None,
    output: str | Path | None = None,
    *,
    blur_px: Annotated[float, Written(name="--blur")] = 1.0,
    noise: float = 2.0,
    make: Make | None = None,
) -> Proposal:
    """Propose pitch and layers for a camera and its field of view, with the markers' predicted error.

    The pattern is the finest that fits the view and is read well: the error per marker grows with finer patterns, the
    distance at which objects are told apart falls. With ``error``, the pattern is the finest whose markers have this
    error.

    >>> proposal = cmpdesign.size("1280x960", "24x18mm", "0.2um")
    >>> proposal.design.write("out")

    Args:
        camera: pixels of the camera, as in 1280x960; or (1280, 960).
        view: width and height of the field of view in the pattern's plane, as in 24x18mm; or two numbers, mm.
        error: largest standard deviation of an inner marker, per axis, as in 0.2um; or a number, mm.
        output: TOML file to write, which build takes; None: none.
        blur_px: sigma of the Gaussian blur of optics and pixel together, in pixels.
        noise: standard deviation of the camera's noise, in 255ths.
        make: product that makes the pad: the pattern is one that build accepts, mirrored as is usual for the
            product; None: only the limits of the camera and of cells count.

    Raises:
        CmpDesignError: a value out of range, an error that the camera cannot reach, with the smallest error, or a view
            on which the product makes no pattern.
        OutputError: the file cannot be written.
    """
    from cmpdesign.files.atomic import write_file
    from cmpdesign.proposal.camera_design import propose

    require_suffix("output", output, ".toml")
    proposal = propose(camera, view, error, blur_px, noise, make)
    if output is not None:
        write_file(Path(output), proposal.to_toml())
    return proposal
