"""Error against the exact bound: patterns, surfaces and blurs by preset. Prints one table."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from cmpdesign.scene import Optics, Scene, cramer_rao, render, standard_layout, standard_scene
from cmpdesign.scene.camera import Camera
from cmpdesign.scene.exact_bound import exact_bound
from cmpdesign.scene.surface import Press, Twist, composed
from cmpdesign.writers.layout_file import layout_to_json
from extractor import Extractor, parse_layout
from extractor.refine import PRESETS

SEEDS = 4
FRAMES = 15  # timed, the fastest counts
SURFACES = {
    "bulge": composed(Press(radius_mm=5.0, depth_mm=1.2)),
    "twist": composed(Twist(radius_mm=5.0, angle_deg=18.0)),
}
CASES = [
    *(
        (pattern, kind, 1.0)
        for pattern in ("honeycomb", "round")
        for kind in ("flat", "tilt", "bulge", "twist")
    ),
    *(("honeycomb", "flat", blur) for blur in (0.6, 1.5, 2.0, 2.5)),
]
HEADER = "pattern    scene  blur  preset    markers  RMS px   / exact  / closed  bias px  norm. err.  refine ms  all ms"


def scene_of(pattern: str, kind: str, blur: float) -> Scene:
    tilt = 35.0 if kind == "tilt" else 0.0
    camera = Camera(pitch_px=20.0, rotation_deg=7.3, tilt_deg=tilt, tilt_axis_deg=30.0)
    plain = standard_scene(standard_layout(pattern))
    return replace(plain, camera=camera, surface=SURFACES.get(kind), optics=Optics(blur))


def rms_per_axis(covariance: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(np.einsum("mii->m", covariance)) / 2))


def time_ms(extractor: Extractor, image: np.ndarray) -> tuple[float, float]:
    """Refinement and the whole cold extraction."""
    refine, whole = [], []
    for _ in range(FRAMES):
        started = time.perf_counter()
        refine.append(extractor.extract(image).timings_ms["refine"])
        whole.append(1e3 * (time.perf_counter() - started))
    return min(refine), min(whole)


def report(pattern: str, kind: str, blur: float) -> None:
    scene = scene_of(pattern, kind, blur)
    inner = scene.layout.marker_layer < scene.layout.marker_layer.max()
    exact, closed = rms_per_axis(exact_bound(scene)[inner]), rms_per_axis(cramer_rao(scene)[inner])
    layout = parse_layout(layout_to_json(scene.layout))
    seen = [render(replace(scene, seed=seed)) for seed in range(SEEDS)]
    for preset in PRESETS:
        extractor = Extractor(layout, preset=preset)
        errors, squares = [], []
        for picture in seen:
            markers = extractor.extract(picture.image)
            error = markers.xy_px - picture.truth.marker_xy_px
            good = inner & picture.truth.visible & np.isfinite(error[:, 0])
            errors.append(error[good])
            inverse = np.linalg.inv(markers.cov_px2[good])
            squares.append(np.einsum("mi,mij,mj->m", error[good], inverse, error[good]))
        every = np.concatenate(errors)
        rms, bias = float(np.sqrt(np.mean(every**2))), float(abs(every.mean(axis=0)).max())
        normalised = float(np.sqrt(np.concatenate(squares).mean() / 2))
        refine_ms, all_ms = time_ms(extractor, seen[0].image)
        print(
            f"{pattern:10s} {kind:6s} {blur:4.1f}  {preset:9s} {len(every) / SEEDS:6.0f}  {rms:.5f}  {rms / exact:7.3f}"
            f"  {rms / closed:8.3f}  {bias:.5f}  {normalised:10.3f}  {refine_ms:9.2f}  {all_ms:6.2f}",
            flush=True,
        )


def main() -> None:
    print(HEADER)
    for case in CASES:
        report(*case)


if __name__ == "__main__":
    main()
