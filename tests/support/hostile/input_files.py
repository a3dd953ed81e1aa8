"""A good file of every kind that the project reads, for tests of all kinds."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from cmpdesign.contact.objects.heightmap import HeightMap
from cmpdesign.design.design import load_design
from cmpdesign.design.templates import templates_folder
from cmpdesign.evaluation.journal import JOURNAL_NAME, Journal
from cmpdesign.evaluation.simulated.sensor import load_sensor
from cmpdesign.files.earlier_files import LIST_NAME, files_with_lists, find_stale_files
from cmpdesign.files.images import read_image
from cmpdesign.files.resolution import resolution_dpi
from cmpdesign.products.laser.coupon.design import coupon_to_json, design_coupon, load_coupon
from cmpdesign.products.laser.library import load_machine, load_material
from cmpdesign.products.laser.setup import complete_setup
from cmpdesign.products.materials.silicones import load_silicone
from cmpdesign.scene import Truth, load_truth, save_truth
from cmpdesign.scene.files.scene_file import load_scene
from cmpdesign.tracking.sources import open_source
from extractor import load_layout, load_rig
from tests.support.layouts import small_layout, small_text

RIG = """
[[view]]
name = "left"
focal_px = [900, 905.5]
centre_px = [319.5, 239.5]
distortion = [-0.1, 0.02, 0.0, 0.0, 0.0]
area_px = [0, 0, 320, 480]
mirrored = false
window_normal = [0.0, 0.1, 1.0]
window_distance_mm = 20.0

[medium]
gel_mm = 4.0
gel_index = 1.41
window_mm = 2.0
window_index = 1.49
"""
SCENE = """
size_px = [320, 240]
seed = 3

[camera]
pitch_px = 20.0

[light]
vignetting = 0.1

[optics]
blur_px = 1.0

[sensor]
noise = 2.0

[inks]
red = "#c8322d"

[medium]
gel_mm = 4.0
gel_index = 1.41
window_mm = 2.0
window_index = 1.49

[contact.elastomer]
thickness_mm = 4.0
young_mpa = 0.3

[contact.indenter]
kind = "ball"
radius_mm = 10.0

[contact.motion]
press_mm = 0.5
"""


@dataclass(frozen=True)
class InputFile:
    """A kind of file.

    Attributes:
        name: its usual name in a folder.
        good: writes a good one.
        read: reads one by the project's reader.
        free: tables whose names are the writer's choice, as dotted paths.
    """

    name: str
    good: Callable[[Path], object]
    read: Callable[[Path], object]
    free: tuple[str, ...] = ()

    def document(self, folder: Path) -> str:
        """The text of a good file."""
        path = folder / f"good-{self.name}"
        self.good(path)
        return path.read_text(encoding="utf-8")


def text(content: Callable[[], str]) -> Callable[[Path], object]:
    return lambda path: path.write_text(content(), encoding="utf-8")


def shipped(name: str) -> Callable[[Path], object]:
    return text(lambda: (templates_folder() / name).read_text(encoding="utf-8"))


def coupon() -> str:
    return coupon_to_json(design_coupon(complete_setup(load_design("tac3d").laser)))


def write_image(path: Path) -> None:
    path.write_bytes(
        cv2.imencode(".png", np.arange(20 * 24 * 3, dtype=np.uint8).reshape(20, 24, 3))[1].tobytes()
    )


def write_heights(path: Path) -> None:
    with path.open("wb") as file:
        np.save(file, np.arange(20.0).reshape(4, 5))


def write_truth(path: Path) -> None:
    count = np.zeros((3, 2))
    nothing = np.zeros((0, 5, 2))
    save_truth(
        Truth(
            count,
            count[:, 0] > 0,
            nothing,
            count[:, 0] > 0,
            False,
            None,
            np.zeros((3, 3)),
            np.zeros((0, 5, 3)),
        ),
        path,
    )


def write_video(path: Path) -> None:
    video = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 30, (32, 24))
    for _ in range(3):
        video.write(np.zeros((24, 32, 3), np.uint8))
    video.release()


def read_journal(path: Path) -> None:
    Journal(path.parent, {"seed": 1}).close()


def write_journal(path: Path) -> None:
    journal = Journal(path.parent, {"seed": 1})
    journal.add("one", {"error": 0.5})
    journal.close()
    if journal.path != path:
        path.write_bytes(journal.path.read_bytes())
        journal.path.unlink()


def file_list() -> str:
    made = files_with_lists({"mold/a.stl": "solid"}, ["mold/"])
    return str(made["mold/" + LIST_NAME])


def read_file_list(path: Path) -> None:
    assert isinstance(find_stale_files(path.parent, {LIST_NAME: ""}), list)


DOCUMENTS: dict[str, InputFile] = {
    "design": InputFile("design.toml", shipped("tac3d.toml"), load_design),
    "machine": InputFile(
        "machine.toml", shipped("machines/co2-40w.toml"), lambda path: load_machine(str(path))
    ),
    "material": InputFile(
        "material.toml", shipped("materials/pdms.toml"), lambda path: load_material(str(path)), ("on",)
    ),
    "silicone": InputFile(
        "silicone.toml", shipped("silicones/solaris.toml"), lambda path: load_silicone(str(path))
    ),
    "sensor": InputFile("sensor.toml", shipped("sensors/tac3d.toml"), load_sensor),
    "scene": InputFile("scene.toml", text(lambda: SCENE), lambda path: load_scene(path, small_layout())),
    "rig": InputFile("rig.toml", text(lambda: RIG), load_rig),
    "layout": InputFile("layout.json", text(small_text), load_layout, ("parameters",)),
    "coupon": InputFile("coupon.json", text(coupon), load_coupon),
}
# Files that earlier runs left in the output folder.
LEFT: dict[str, InputFile] = {
    "journal": InputFile(JOURNAL_NAME, write_journal, read_journal),
    "list of files": InputFile(LIST_NAME, text(file_list), read_file_list),
}
DATA: dict[str, InputFile] = {
    "image": InputFile("image.png", write_image, read_image),
    "resolution": InputFile("image.png", write_image, lambda path: resolution_dpi(path)),
    "height map": InputFile("heights.npy", write_heights, lambda path: HeightMap.read(path, 0.1)),
    "truth": InputFile("truth.npz", write_truth, load_truth),
    "video": InputFile("video.avi", write_video, lambda path: open_source(str(path))),
}
EVERY = {**DOCUMENTS, **LEFT, **DATA}


def as_text(document: Any, like: InputFile) -> str:
    """A document as TOML or JSON, by the kind's name."""
    if like.name.endswith(".toml"):
        return "\n".join(
            f"{json.dumps(key, ensure_ascii=False)} = {toml(value)}" for key, value in document.items()
        )
    return json.dumps(document)


def toml(value: Any) -> str:
    """A value as TOML, tables written inline."""
    if isinstance(value, dict):
        inner = ", ".join(
            f"{json.dumps(key, ensure_ascii=False)} = {toml(item)}" for key, item in value.items()
        )
        return f"{{ {inner} }}"
    if isinstance(value, list):
        return f"[{', '.join(map(toml, value))}]"
    if isinstance(value, float):
        return repr(value)
    return json.dumps(value, ensure_ascii=True)
