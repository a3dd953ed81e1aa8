"""``cmpdesign kerf``: measures the kerf in a photo or scan of a cut coupon."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cmpdesign.cli.image_options import MaxPixelsOption
from cmpdesign.cli.terminal import console, print_document
from cmpdesign.inputs.files import MOST_PIXELS

if TYPE_CHECKING:
    from cmpdesign.products.laser.coupon.photo import CouponReading, PatchKerf


def kerf(
    coupon: Annotated[Path, typer.Argument(metavar="COUPON", help="The coupon.json that build wrote.")],
    photo: Annotated[Path, typer.Argument(metavar="PHOTO", help="A photo or scan of the cut piece.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print the figures as JSON instead.")] = False,
    max_pixels: MaxPixelsOption = MOST_PIXELS,
) -> None:
    """Measure the kerf on a coupon, ready for the material's file."""
    from cmpdesign.errors import CmpDesignError
    from cmpdesign.files.images import read_image
    from cmpdesign.products.laser.coupon.design import load_coupon
    from cmpdesign.products.laser.coupon.photo import PhotoError, read_coupon

    cut_coupon = load_coupon(coupon)
    image = read_image(photo, max_pixels)
    try:
        reading = read_coupon(cut_coupon, image)
    except PhotoError as error:
        raise CmpDesignError(f"{photo}: {error}") from None
    if as_json:
        print_document(json.dumps(_reading_to_json(reading), indent=2) + "\n")
        return
    _print_kerf_table(reading)
    console().print(f"\nfor the file of {cut_coupon.material}, the settings of {cut_coupon.machine}:")
    for patch_kerf in reading.patches:
        console().print(_material_file_lines(patch_kerf, photo.name))


def _print_kerf_table(reading: CouponReading) -> None:
    from rich.table import Table

    side = "back" if reading.from_back else "front"
    console().print(
        f"seen from the {side}, {reading.scale_px_mm:.1f} px in a mm, marks fit to {1000 * reading.fit_mm:.1f} um"
    )
    table = Table(box=None, pad_edge=False)
    for heading in ("patch", "power", "speed", "times over", "kerf x", "kerf y"):
        table.add_column(heading, justify="left" if heading == "patch" else "right")
    for patch_kerf in reading.patches:
        patch = patch_kerf.patch
        widths = [
            f"{width.value_mm:.4f} +- {width.sigma_mm:.4f} mm" for width in (patch_kerf.x, patch_kerf.y)
        ]
        power, speed = f"{patch.power_percent:g} %", f"{patch.speed_mm_s:g} mm/s"
        table.add_row(patch.name, power, speed, str(patch.passes), *widths)
    console().print(table)


def _material_file_lines(patch_kerf: PatchKerf, photo: str) -> str:
    """The lines of the material's file for one patch."""
    patch = patch_kerf.patch
    lines = [f"# {patch.name}: {patch.power_percent:g} %, {patch.speed_mm_s:g} mm/s, {patch.passes} times"]
    for axis, width in (("x", patch_kerf.x), ("y", patch_kerf.y)):
        source = json.dumps(f"coupon {patch.name}, {photo}, +- {width.sigma_mm:.4f} mm", ensure_ascii=False)
        lines.append(f"kerf_{axis}_mm = {{ value = {width.value_mm:.4f}, source = {source} }}")
    return "\n".join(lines)


def _reading_to_json(reading: CouponReading) -> dict[str, object]:
    return {
        "format": "cmp-kerf",
        "version": 1,
        "from_back": reading.from_back,
        "scale_px_mm": round(reading.scale_px_mm, 4),
        "fit_mm": round(reading.fit_mm, 6),
        "patches": [
            {
                "name": one.patch.name,
                "power_percent": one.patch.power_percent,
                "speed_mm_s": one.patch.speed_mm_s,
                "passes": one.patch.passes,
                "kerf_x_mm": round(one.x.value_mm, 5),
                "kerf_x_sigma_mm": round(one.x.sigma_mm, 5),
                "kerf_y_mm": round(one.y.value_mm, 5),
                "kerf_y_sigma_mm": round(one.y.sigma_mm, 5),
            }
            for one in reading.patches
        ],
    }
