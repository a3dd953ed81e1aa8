"""A calibrated camera as files: TOML for rigs and sensors, YAML for OpenCV, YAML for ROS."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from cmpdesign.calibration.camera import CameraCalibration
from extractor import View

Array = NDArray[np.float64]

ROS_MODELS = {5: "plumb_bob", 8: "rational_polynomial", 12: "rational_polynomial", 4: "equidistant"}


def camera_toml(found: CameraCalibration, response: str | float, date: str | None = None) -> str:
    """The text of a sensor file with the camera's view and [calibration.camera].

    Args:
        found: the calibration.
        response: of the camera, as the pictures were read.
        date: of the pictures, YYYY-MM-DD.
    """
    view, size = found.camera, found.adjusted.problem.size_px
    refused = [f"{one.picture}: {one.cause}" for one in found.pictures if not one.used]
    lines = [
        f"size_px = [{size[0]}, {size[1]}]",
        f"response = {_quoted(response) if isinstance(response, str) else repr(response)}",
        "",
        "[[view]]",
        f"name = {_quoted(view.name)}",
        *_intrinsics(view),
        "",
        "[calibration.camera]",
        *([f"date = {date}"] if date else []),
        f"model = {_quoted(found.model.name)}",
        f"pictures = {sum(one.used for one in found.pictures)}",
        f"refused = [{', '.join(_quoted(text) for text in refused)}]",
        f"points = {sum(one.points for one in found.pictures if one.used)}",
        f"rms_px = {found.rms_px:.6g}          # residuals, per axis",
        f"scale = {found.adjusted.base:.4g}            # residuals over the stated deviations of the points",
        f"ray_px = {found.ray_px:.6g}          # RMS deviation of the rays over the image, per axis",
        f"sheet_bend_mm = {found.bend_mm:.4g}",
        f"held = [{', '.join(map(_quoted, found.held))}]",
        f"parameters = [{', '.join(map(_quoted, found.model.names))}]",
        "covariance = [",
        *(f"  [{_numbers(row)}]," for row in found.cov),
        "]",
    ]
    return "\n".join(lines) + "\n"


def _intrinsics(view: View) -> list[str]:
    return [
        f"focal_px = [{_numbers(view.focal_px)}]",
        f"centre_px = [{_numbers(view.centre_px)}]",
        f"lens = {_quoted(view.lens)}",
        f"distortion = [{_numbers(view.distortion)}]",
    ]


def _numbers(values: Iterable[float]) -> str:
    return ", ".join(f"{float(value):.10g}" if value else "0.0" for value in values)


def _quoted(text: str) -> str:
    clean = "".join(letter if letter.isprintable() else "?" for letter in text)
    return '"' + clean.replace("\\", "\\\\").replace('"', '\\"') + '"'


def camera_matrix(view: View) -> Array:
    """(3, 3) OpenCV's camera matrix."""
    (fx, fy), (cx, cy) = view.focal_px, view.centre_px
    return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


def opencv_yaml(found: CameraCalibration) -> str:
    """The text that ``cv2.FileStorage`` reads: the names of OpenCV's calibration example."""
    view, size = found.camera, found.adjusted.problem.size_px
    blocks = {"camera_matrix": camera_matrix(view), "distortion_coefficients": np.array([view.distortion])}
    lines = ["%YAML:1.0", "---", f"image_width: {size[0]}", f"image_height: {size[1]}"]
    lines.append(f"fisheye_model: {int(view.lens == 'fisheye')}")
    for name, matrix in blocks.items():
        lines += [f"{name}: !!opencv-matrix", f"   rows: {matrix.shape[0]}", f"   cols: {matrix.shape[1]}"]
        lines += ["   dt: d", f"   data: [ {_numbers(matrix.ravel())} ]"]
    lines.append(f"avg_reprojection_error: {found.rms_px * np.sqrt(2):.6g}")
    return "\n".join(lines) + "\n"


def ros_yaml(found: CameraCalibration) -> str:
    """The text that ROS' ``camera_info_manager`` reads."""
    view, size = found.camera, found.adjusted.problem.size_px
    matrix = camera_matrix(view)
    lines = [f"image_width: {size[0]}", f"image_height: {size[1]}", f"camera_name: {view.name}"]
    lines += _ros_matrix("camera_matrix", matrix)
    lines.append(f"distortion_model: {ROS_MODELS[len(view.distortion)]}")
    lines += _ros_matrix("distortion_coefficients", np.array([view.distortion]))
    lines += _ros_matrix("rectification_matrix", np.eye(3))
    lines += _ros_matrix("projection_matrix", np.pad(matrix, ((0, 0), (0, 1))))
    return "\n".join(lines) + "\n"


def _ros_matrix(name: str, matrix: Array) -> Sequence[str]:
    rows, columns = matrix.shape
    return [f"{name}:", f"  rows: {rows}", f"  cols: {columns}", f"  data: [{_numbers(matrix.ravel())}]"]
