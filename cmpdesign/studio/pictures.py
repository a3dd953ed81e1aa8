"""Pictures for the page: the pad as the camera sees it, the paths of the laser with their times, residuals."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from cmpdesign.files.images import to_png
from cmpdesign.patterns.colors import COLORS
from cmpdesign.studio.designs import Look, design_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from extractor import Markers, Reference

BLUR_PX = 1.0
RESIDUAL_SIGMAS = 8.0  # of black and white in a picture of residuals
_FITTED_PIXELS = 40_000  # from which the light of the inks is estimated
_OUTLIER_SIGMAS = 4.0  # of a pixel that shows something else than the pattern
_MEDIAN_TO_SIGMA = 1.4826  # of normal errors
_COVERED = 0.999  # share of a pixel that cells cover
_POWERS = ((0, 0), (0, 1), (1, 0), (0, 2), (1, 1), (2, 0))  # of y and x
_PIXEL_VARIANCE = 1 / 12  # of a box
_BLURS2_PX2 = (0.1**2, 20.0**2)  # that can be drawn
_DECIMALS = 3  # of a path on the screen, mm


def seen_picture(asked: Mapping[str, Any]) -> bytes:
    """The pad as a camera sees it whose picture the pattern fills, as PNG.

    Raises:
        DesignError: see ``design_of``.
    """
    from cmpdesign.products.as_made.reading import filling_view
    from cmpdesign.scene import Camera, Optics, Scene, render

    layout, look = design_of(asked.get("fields")).layout, Look.of(asked)
    camera_turn_deg, scale = filling_view(layout, look.camera_px)
    camera = Camera(scale * float(layout.parameters["pitch_mm"]), camera_turn_deg)
    return to_png(render(Scene(layout, camera, optics=Optics(BLUR_PX)), size=look.camera_px).image)


def laser_document(asked: Mapping[str, Any]) -> dict[str, Any]:
    """The passes of the laser job of a design in burning order: paths, times, and the cells as made.

    Places are in mm on a drawing with y down, from the top left of the job's extent. ``begin_s`` are the starts of the
    strokes of one repeat; the beam travels from the end of a stroke to the start of the next.

    Raises:
        DesignError: see ``design_of``; or a job that cannot be.
        MissingLibraryError: the extra of laser jobs is not installed.
    """
    import numpy as np

    from cmpdesign.products.laser.figures import pass_timing
    from cmpdesign.products.laser.job import make_job
    from cmpdesign.products.laser.make import prepare_laser
    from cmpdesign.products.laser.paths.timing import begin_times_s
    from cmpdesign.products.laser.setup import complete_setup

    design = design_of(asked.get("fields"))
    job = make_job(design.name, design.layout, complete_setup(design.laser))
    machine, (left, _, _, top) = job.setup.machine, job.extent_mm

    def drawn(xy_mm: Any) -> Any:
        return np.round((xy_mm - (left, top)) * (1, -1), _DECIMALS).tolist()

    passes = []
    for one in job.passes:
        strokes = one.burn_strokes(0)
        times = begin_times_s(
            strokes, one.speed_mm_s, machine.travel_mm_s.value, machine.acceleration_mm_s2.value
        )
        passes.append(
            {
                "name": one.name,
                "color": "#808080" if one.color is None else job.layout.palette[COLORS[one.color]],
                "strokes": [drawn(stroke) for stroke in strokes],
                "begin_s": times[0].round(4).tolist(),
                "end_s": round(times[1], 4),
                "repeats": one.repeats,
                "time_s": pass_timing(job, one).time_s,
            }
        )
    pad = prepare_laser(design, design.layout).made_pad
    assert pad is not None
    made = pad.layout.colored_outlines_mm + job.origin_mm
    return {
        "passes": passes,
        "size_mm": [job.extent_mm.right - left, top - job.extent_mm.bottom],
        "made": [drawn(ring) for ring in made],
        "kerf_mm": job.setup.kerf_x_mm,
        "assumed": list(job.setup.assumed),
    }


def residual_picture(image: NDArray[Any], reference: Reference, markers: Markers) -> NDArray[Any]:
    """What a drawing of the found markers leaves of an image: dirt, glare, a cell of another color, a wrong place.

    The cells between found markers are drawn with straight sides and the image's blur; the light of every ink is a
    quadratic over the image (robust least squares).

    Args:
        image: (H, W, 3) uint8 BGR.
        reference: the layout.
        markers: of the image, with their ``stages``.

    Returns:
        (H, W, 3) uint8 BGR: 128 where nothing is left and outside of the cells, 0 and 255 at ``RESIDUAL_SIGMAS``
        deviations of the residual.
    """
    import numpy as np

    from extractor.image.response import light_of_values

    light, values = light_of_values("srgb"), np.arange(256.0)
    coverage = _ink_coverage(reference, markers, (image.shape[1], image.shape[0]))
    shown = coverage.sum(axis=0) > _COVERED
    picked = np.flatnonzero(shown)[:: max(1, int(shown.sum()) // _FITTED_PIXELS)]
    rows, columns = (np.linspace(-1, 1, count) for count in shown.shape)
    y, x = rows[picked // len(columns)], columns[picked % len(columns)]
    terms = np.stack([y**i * x**j for i, j in _POWERS], axis=1)
    matrix = np.einsum("kn,nt->nkt", coverage.reshape(len(coverage), -1)[:, picked], terms)
    matrix, seen = matrix.reshape(len(picked), -1), image.reshape(-1, 3)[picked]
    kept, sigma = np.ones(len(picked), np.bool_), np.ones(3)
    for _ in range(2):
        weights = np.linalg.lstsq(matrix[kept], light[seen[kept]], rcond=None)[0]
        left = seen - np.interp(matrix @ weights, light, values)
        sigma = np.maximum(_MEDIAN_TO_SIGMA * np.median(np.abs(left), axis=0), 0.5)
        kept = (np.abs(left) < _OUTLIER_SIGMAS * sigma).all(axis=1)
    table = np.zeros((3, 3, len(coverage), 3))  # of powers of y and x, inks and channels
    table[tuple(zip(*_POWERS, strict=True))] = weights.reshape(len(coverage), len(_POWERS), 3).swapaxes(0, 1)
    picture = np.full(image.shape, 128, np.uint8)
    for channel in range(3):
        levels = np.polynomial.polynomial.polygrid2d(rows, columns, table[..., channel])
        left = image[..., channel] - np.interp((coverage * levels).sum(axis=0), light, values)
        scaled = np.rint(128 + 127.5 / RESIDUAL_SIGMAS * left / sigma[channel])
        picture[..., channel][shown] = np.clip(scaled, 0, 255)[shown]
    return picture


def _ink_coverage(reference: Reference, markers: Markers, size_px: tuple[int, int]) -> NDArray[Any]:
    """(inks, H, W) float32, share of each pixel that the cells of an ink cover, blurred as the image is."""
    import numpy as np

    from cmpdesign.scene.drawing.coverage import draw_coverage
    from cmpdesign.scene.drawing.paths import PolygonSegments
    from cmpdesign.scene.parts.optics import make_point_spread

    corners_px = markers.xy_px[reference.cell_corners]
    known = np.isfinite(corners_px).all(axis=(1, 2))
    corners_px, color = corners_px[known], reference.cell_color[known]
    sides = np.concatenate([corners_px, np.roll(corners_px, -1, axis=1)], axis=2).reshape(-1, 4)
    owner = np.repeat(np.arange(len(corners_px)), corners_px.shape[1])
    values = (color[:, None] == np.unique(color)).astype(np.float64)
    refined = markers.stages["refine"]  # its blur has the pixel of the image at the scale of refinement
    blur2_px2 = refined.blur_px**2 - refined.appearance.scale**2 * _PIXEL_VARIANCE
    spread = make_point_spread(float(np.sqrt(np.clip(blur2_px2, *_BLURS2_PX2))))
    return draw_coverage(PolygonSegments(sides, owner), values, size_px, spread)
