"""``cmpdesign kerf``: the kerf in a photo or scan of a cut coupon, and the lines for the material's file."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from cmpdesign.api import workshop
from cmpdesign.cli.command import app
from cmpdesign.cli.derived import command
from cmpdesign.cli.records import print_parts, print_rows
from cmpdesign.cli.terminal import say, say_columns

if TYPE_CHECKING:
    from cmpdesign.documents.reading import GridDocument, GridFieldPart, KerfDocument, PatchPart
    from cmpdesign.products.laser.grid.reading import FieldReading


@command(
    app,
    workshop.kerf,
    "reading the picture",
    "cmpdesign kerf coupon.json scan.png",
    "cmpdesign kerf grid.json photo.jpg --json",
)
def kerf(done: KerfDocument | GridDocument, given: Mapping[str, Any]) -> None:
    """A grid of settings is read, too. The lines for the material's file are printed."""
    from cmpdesign.products.laser.coupon.design import load_coupon

    coupon, photo = load_coupon(given["coupon"]), given["photo"].name
    if done.format == "cmp-grid":
        _print_fields(done.fields)
        print_rows(done, "scale_px_mm from_back best")
        if done.best is None:
            say("\nno field cuts through with a pass in reserve: raise the power, or lower the speed")
            return
        lines = list(_settings_lines(done.found.best, photo))
    else:
        print_parts(
            done.patches,
            "name power_percent speed_mm_s passes kerf_x_mm kerf_x_back_mm kerf_y_mm kerf_y_back_mm",
        )
        print_rows(done, "scale_px_mm fit_mm response from_back face taper_deg taper_assumed thickness_mm")
        lines = [line for patch in done.patches for line in _kerf_lines(patch, done.face, photo)]
    say(f"\nfor the file of {coupon.material}, the settings of {coupon.machine}:")
    say("\n".join(lines))


def _print_fields(fields: Sequence[GridFieldPart]) -> None:
    """The windows of every field by their passes, and the bounds of the depth of a pass."""
    counts = [f"{count} x" for count in fields[0].windows]
    rows = []
    for one in fields:
        low, high = one.least_depth_per_pass_mm, one.most_depth_per_pass_mm
        depth = f"{low:.3g} or more" if high is None else f"{low:.3g} to {high:.3g}"
        rows.append((one.name, f"{one.power_percent:g}", f"{one.speed_mm_s:g}", *one.windows.values(), depth))
    say_columns(("name", ">power %", ">speed mm/s", *counts, "depth a pass, mm"), rows)


def _settings_lines(one: FieldReading, photo: str) -> Iterator[str]:
    """The settings that cut, with one number of passes in reserve."""
    assert one.passes is not None
    source = json.dumps(f"grid {one.name}, {photo}: through with {one.passes} passes", ensure_ascii=False)
    values = {
        "cut_power_percent": f"{one.power_percent:g}",
        "cut_speed_mm_s": f"{one.speed_mm_s:g}",
        "cut_passes": str(min(count for count in one.states if count > one.passes)),
    }
    for name, value in values.items():
        yield f"{name} = {{ value = {value}, source = {source} }}"


def _kerf_lines(patch: PatchPart, face: str, photo: str) -> Iterator[str]:
    """The lines of the material's file for one patch: the kerf at the front, and both faces in its source."""
    yield f"# {patch.name}: {patch.power_percent:g} %, {patch.speed_mm_s:g} mm/s, {patch.passes} times"
    for axis in "xy":
        front_mm, back_mm, sigma_mm = (
            getattr(patch, f"kerf_{axis}{which}_mm") for which in ("", "_back", "_sigma")
        )
        source = json.dumps(
            f"coupon {patch.name}, {photo}: front {front_mm:.4f} mm, back {back_mm:.4f} mm, {face} seen, "
            f"+- {sigma_mm:.4f} mm",
            ensure_ascii=False,
        )
        yield f"kerf_{axis}_mm = {{ value = {front_mm:.4f}, source = {source} }}"
