"""``cmpdesign render``: renders a pattern or a scene to an image, a video or a folder, with the ground truth."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cmpdesign.api import pictures
from cmpdesign.cli.derived import derived
from cmpdesign.cli.terminal import print_step, print_warning, printable_path, say

if TYPE_CHECKING:
    from cmpdesign.documents.runs import RenderDocument

EXAMPLES = (
    "cmpdesign render layout.json -o sample.png --pitch 22 --tilt 15 --noise 2",
    "cmpdesign render layout.json -o pressed.png --scene pressed-ball --truth pressed.npz",
)


@derived(pictures.render, "rendering")
def render(done: RenderDocument) -> None:
    """With a sequence as the scene, a video or a folder of pictures is written."""
    print_step("the image is rendered")
    for warning in done.warnings:
        print_warning(warning)
    *truth, output = map(printable_path, done.written)
    for path in truth:
        say(f"wrote {path}")
    say(f"wrote {output}: {_describe(done)}")


def _describe(done: RenderDocument) -> str:
    width, height = done.size_px
    if done.visible is None:
        return f"{done.frames} frames of {width} x {height} px at {done.fps:g} fps"
    views = f" in {len(done.visible)} views" if len(done.visible) > 1 else ""
    return f"{width} x {height} px, {' + '.join(map(str, done.visible))} markers visible{views}"
