"""Measurements of one machine, one pad, one sensor: ``kerf``, ``calibrate``, ``evaluate`` of the command line."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from cmpdesign.api.layouts import reference_from
from cmpdesign.design.design import Design as Parameters
from cmpdesign.errors import CmpDesignError
from cmpdesign.inputs.files import MOST_PIXELS
from cmpdesign.watch import tell

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cmpdesign.documents.runs import EvaluateDocument, ExportDocument
    from cmpdesign.layout.layout import Layout as AnyLayout
    from cmpdesign.products.laser.coupon.photo import CouponReading
    from cmpdesign.products.laser.grid.reading import GridReading
    from extractor import LayoutLike, LearntLayout
    from extractor.presets import Preset

Response = Literal["srgb", "linear"] | float


def kerf(
    coupon: str | Path,
    photo: str | Path,
    *,
    face: Literal["front", "back"] | None = None,
    response: Response | None = None,
    max_pixels: int = MOST_PIXELS,
) -> CouponReading:
    """Measure the kerf in a photo or scan of a cut coupon, as the command ``kerf`` does.

    >>> reading = cmpdesign.kerf("made/laser/coupon.json", "scan.png")
    >>> [(one.patch.name, one.x.value_mm, one.y.value_mm) for one in reading.patches]

    Args:
        coupon: the coupon.json that a build wrote.
        photo: photo or scan of the cut piece.
        face: face of the sheet whose openings are seen; None: the face with the narrower openings, by the taper.
        response: relation of light and values; None: the response in the file, else sRGB, corrected by the edges.
        max_pixels: largest image that is read, width x height.

    Raises:
        CmpDesignError: a file that cannot be read, or a picture that does not show the coupon.
    """
    from cmpdesign.files.images import read_image
    from cmpdesign.products.laser.coupon.design import load_coupon
    from cmpdesign.products.laser.coupon.photo import read_coupon
    from cmpdesign.products.laser.coupon.picture import PhotoError
    from cmpdesign.products.laser.coupon.stated_response import stated_response

    cut_coupon = load_coupon(Path(coupon))
    if cut_coupon.kind != "kerf":
        raise CmpDesignError(
            f"{coupon}: a grid of settings; give the coupon.json beside it, or call laser_grid"
        )
    image = read_image(photo, max_pixels, gray=True)
    try:
        return read_coupon(
            cut_coupon, image, response=response, stated=stated_response(Path(photo)), face=face
        )
    except PhotoError as error:
        raise CmpDesignError(f"{photo}: {error}") from None


def laser_grid(
    coupon: str | Path,
    photo: str | Path,
    *,
    response: Response | None = None,
    max_pixels: int = MOST_PIXELS,
) -> GridReading:
    """Read which settings cut through, in a photo of a burnt grid, as the command ``kerf`` does with a grid.json.

    >>> reading = cmpdesign.laser_grid("made/laser/grid.json", "grid.jpg")
    >>> reading.best.name, reading.best.passes

    Args:
        coupon: the grid.json that a build wrote.
        photo: photo or scan of the piece, with loose pieces pushed out.
        response, max_pixels: see ``kerf``.

    Raises:
        CmpDesignError: a file that cannot be read, or a picture that does not show the grid.
    """
    from cmpdesign.files.images import read_image
    from cmpdesign.products.laser.coupon.design import load_coupon
    from cmpdesign.products.laser.coupon.picture import PhotoError
    from cmpdesign.products.laser.grid.reading import read_grid

    burnt = load_coupon(Path(coupon))
    if burnt.kind != "grid":
        raise CmpDesignError(f"{coupon}: a coupon for the kerf; give the grid.json beside it")
    try:
        return read_grid(burnt, read_image(photo, max_pixels, gray=True), response or "srgb")
    except PhotoError as error:
        raise CmpDesignError(f"{photo}: {error}") from None


def calibrate_pattern(
    layout: LayoutLike | AnyLayout,
    images: str | Path | Sequence[str | Path] | Sequence[NDArray[Any]],
    output: str | Path | None = None,
    *,
    preset: Preset = "accurate",
    response: Response | None = None,
    max_pixels: int = MOST_PIXELS,
) -> LearntLayout:
    """Measure the places of one pad's markers, as the command ``calibrate pattern`` does.

    >>> made = cmpdesign.calibrate_pattern("layout.json", "at_rest/", "made.json")
    >>> extractor.Extractor("made.json")                  # reads this pad with its own places

    Args:
        layout: the nominal layout: a layout, the path of a layout file, a ``Reference``, or its JSON object.
        images: 10 or more color pictures of one pad at rest: files, folders of files, patterns such as "rest/*.png",
            or arrays (H, W, 3) BGR.
        output: layout file to write, with the measured places; None: none.
        preset, response: see ``extractor.Extractor``.
        max_pixels: largest image that is read, width x height.

    Raises:
        CmpDesignError, extractor.ExtractorError: files that cannot be read, or pictures from which no places follow.
        OutputError: the layout file cannot be written.
    """
    from cmpdesign.files.layout_json import write_layout
    from cmpdesign.reading.read_layout import layout_from_reference
    from extractor import learn_layout

    if output is not None and Path(output).suffix.lower() != ".json":
        raise CmpDesignError(f"{output}: unknown ending of a layout file; expected .json")
    if (
        output is not None
        and isinstance(layout, str | Path)
        and Path(output).resolve() == Path(layout).resolve()
    ):
        raise CmpDesignError(f"{output} is the nominal layout itself; give another name")
    names, pictures = read_pictures([images] if isinstance(images, str | Path) else images, max_pixels)
    learnt = learn_layout(
        reference_from(layout),
        pictures,
        names=names,
        watch=partial(tell, unit="pictures"),
        preset=preset,
        response=response,
    )
    if output is not None:
        write_layout(layout_from_reference(learnt.layout), Path(output))
    return learnt


def read_pictures(
    images: Sequence[str | Path] | Sequence[NDArray[Any]], max_pixels: int
) -> tuple[list[str], list[NDArray[Any]]]:
    """The names and the pixels of pictures; a folder or a pattern stands for its pictures."""
    from cmpdesign.files.images import read_image
    from cmpdesign.inputs.sources import picture_paths

    names: list[str] = []
    pictures: list[NDArray[Any]] = []
    for image in images:
        if not isinstance(image, str | Path):
            names.append(f"picture {len(names) + 1}")
            pictures.append(image)
            continue
        for path in picture_paths([str(image)]):
            names.append(str(path))
            pictures.append(read_image(path, max_pixels))
    return names, pictures


def evaluate(
    experiment: Literal["precision", "response", "reliability", "angles", "designs"],
    output: str | Path,
    designs: Mapping[str, Parameters] | None = None,
    *,
    trials: int | None = None,
    seed: int = 0,
    workers: int | None = None,
    sensor: str | Path = "tac3d",
    preset: str = "balanced",
) -> EvaluateDocument:
    """Run an experiment on a simulated sensor, as the commands ``evaluate NAME`` do.

    >>> cmpdesign.evaluate("designs", "compared", {"ten": load("tac3d"), "eight": load("tac3d", layers=8)})

    Args:
        experiment: the command's name.
        output: folder for report.html, report.json and the journal; the same call continues an interrupted run.
        designs: name -> design; for "designs" only.
        trials: places for every contact, object or mode; None: the command's default.
        seed: seed of all random values.
        workers: processes; None: one for each core.
        sensor: name of a sensor template, or a TOML file.
        preset: the reader's preset: "balanced" or "accurate".

    Returns:
        The written files, and the JSON object of report.json.

    Raises:
        CmpDesignError: a value out of range, or the folder holds a run under other conditions.
        OutputError: a file cannot be written; finished trials are kept.
    """
    from cmpdesign.documents.runs import EvaluateDocument
    from cmpdesign.evaluation import experiments
    from cmpdesign.evaluation.defaults import PRESETS, USUAL_TRIALS
    from cmpdesign.evaluation.designs import design_entries
    from cmpdesign.evaluation.runner import RunOptions
    from cmpdesign.evaluation.simulated.sensor import load_sensor

    if preset not in PRESETS:
        raise CmpDesignError(f"preset {preset}: unknown; there are {', '.join(PRESETS)}")
    compared = design_entries(designs or {}) if experiment == "designs" else ()
    found = experiments.find_experiment(experiment, compared)
    count = USUAL_TRIALS[experiment] if trials is None else trials
    options = RunOptions(count, seed, load_sensor(sensor).text, preset, workers or os.cpu_count() or 1)
    report, files = experiments.run_experiment(found, options, Path(output))
    return EvaluateDocument(written=tuple(map(str, files)), report=report)


def export_lerobot(
    runs: Sequence[str | Path],
    output: str | Path,
    *,
    task: str = "contact",
    fps: float | None = None,
    robot: str | None = None,
    images: Sequence[str | Path] = (),
    max_pixels: int = MOST_PIXELS,
) -> ExportDocument:
    """Write runs as a LeRobotDataset v3.0, as the command ``export lerobot`` does.

    Args:
        runs: .npz files of ``track`` or ``reconstruct``; each file is an episode.
        output: data set to write; a new folder.
        task: task that the runs show, in words.
        fps: frames per second; None: from the runs' times.
        robot: type of the robot; None: none.
        images: video or folder of images of each run, in order; empty: no images.
        max_pixels: largest image that is read, width x height.

    Raises:
        CmpDesignError: a library is missing, or the runs or their images cannot be used together.
        OutputError: the data set cannot be written, or the folder exists.
    """
    from cmpdesign.documents.runs import ExportDocument
    from cmpdesign.tracking.export.lerobot import LeRobotDataSet, write_lerobot
    from cmpdesign.tracking.export.runs import frames_per_second, require_one_kind, tidy_fps

    paths = _paths(runs)
    require_one_kind(paths)
    rate = frames_per_second(paths) if fps is None else tidy_fps(fps)
    about = LeRobotDataSet(rate, task, robot, tuple(map(str, images)), max_pixels)
    frames = write_lerobot(paths, Path(output), about)
    return ExportDocument(kind="lerobot", written=str(output), episodes=len(paths), frames=frames, fps=rate)


def export_zarr(
    runs: Sequence[str | Path],
    output: str | Path,
    *,
    images: Sequence[str | Path] = (),
    max_pixels: int = MOST_PIXELS,
) -> ExportDocument:
    """Write runs as a replay buffer in the form of Diffusion Policy, as the command ``export zarr`` does.

    Args:
        runs, images, max_pixels: see ``export_lerobot``.
        output: buffer to write; a new .zarr folder.

    Raises:
        CmpDesignError, OutputError: see ``export_lerobot``.
    """
    from cmpdesign.documents.runs import ExportDocument
    from cmpdesign.tracking.export.zarr_buffer import write_zarr

    if Path(output).suffix != ".zarr":
        raise CmpDesignError(f"{output}: unknown ending of a replay buffer; expected .zarr")
    paths = _paths(runs)
    frames = write_zarr(paths, Path(output), tuple(map(str, images)), max_pixels)
    return ExportDocument(kind="zarr", written=str(output), episodes=len(paths), frames=frames, fps=None)


def _paths(runs: Sequence[str | Path]) -> list[Path]:
    """The files; a single name would be split into letters.

    Raises:
        CmpDesignError: one name instead of a list.
    """
    if isinstance(runs, str | Path):
        raise CmpDesignError(f"runs is {str(runs)!r}; give a list of files, as [{str(runs)!r}]")
    return [Path(run) for run in runs]
