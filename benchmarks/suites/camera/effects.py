"""The effects in the order of a camera. Each changes a chain with a strength from 0 (no change) to 1 (the largest).

Directions, signs and kinds are drawn at random. A new effect is one line in ``EFFECTS``, and a function where more than
a field of ``parts`` changes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np

from benchmarks.suites.camera.lamps import blackbody_rgb, led_rgb
from benchmarks.suites.camera.parts import PIGMENTS, RGB, Chain, Demosaicing, Inks, Surround, SurroundKind
from cmpdesign.scene import Led, Light

Rng = np.random.Generator
Effect = Callable[[Chain, float, Rng], Chain]

NEUTRAL_K, WARMEST_K, COLDEST_K = 6500.0, 2500.0, 15000.0
MIN_EXPOSURE, MAX_EXPOSURE = 0.1, 8.0
BEST_QUALITY, WORST_QUALITY, FIRST_STRENGTH = 95, 15, 0.25  # of JPEG; the best quality up to this strength
SURROUNDS: tuple[tuple[SurroundKind, RGB], ...] = (
    ("plain", (0.85, 0.85, 0.83)),
    ("plain", (0.21, 0.21, 0.21)),
    ("plain", (0.01, 0.01, 0.01)),
    ("wood", (0.33, 0.18, 0.08)),
    ("skin", (0.52, 0.29, 0.20)),
)
WEAKEST_CHANNEL, WEAK_CHANNELS = 0.05, 0.2  # of the light of the strongest channel
MAX_LIFTED = 0.22  # of the largest light: to 130 of 255
SHARP_BLUR_PX, SOFT_BLUR_PX = 0.5, 1.1  # of the lens before a mosaic: a sharp one shows false colors


def change_inks(chain: Chain, strength: float, rng: Rng) -> Chain:
    """Reflectances drawn at random in the range of prints and pigments, as they are, faded or dark."""
    target = sample_inks(rng)
    fading = strength * float(rng.choice((0.0, 0.35, 0.0)))
    darkness = strength * float(rng.choice((0.0, 0.0, 0.75)))
    inks = {}
    for item in fields(Inks):
        drawn, standard = np.array(getattr(target, item.name)), np.array(getattr(chain.inks, item.name))
        ink = standard + strength * (drawn - standard)
        ink = ink + fading * (np.array(target.white) - ink)
        inks[item.name] = _rgb(ink * (1.0 - darkness))
    return replace(chain, inks=Inks(**inks))


def sample_inks(rng: Rng) -> Inks:
    """Random inks: each colored ink is strongest in its channel, black is dark and white is bright, both tinted."""
    low, high = (0.02, 0.02, 0.01), (0.10, 0.12, 0.08)
    red, green, blue = (rng.uniform(low, high) for _ in range(3))
    red[0], green[1], blue[2] = rng.uniform((0.35, 0.20, 0.25), (0.70, 0.45, 0.60))
    blue[1] = rng.uniform(0.03, 0.20)
    green[2] = rng.uniform(0.03, 0.15)
    white = rng.uniform(0.60, 0.92) * rng.uniform((0.95, 0.92, 0.82), 1.0)
    black = rng.uniform(0.004, 0.05) * rng.uniform(0.8, 1.2, 3)
    return Inks(_rgb(red), _rgb(green), _rgb(blue), _rgb(white), _rgb(black))


def change_lamps(chain: Chain, strength: float, rng: Rng) -> Chain:
    """One to three lamps at the image's rim over a diffuse one, white of any temperature or colored LEDs.

    The white balance follows their mean color in part.
    """
    count = int(rng.integers(1, 4))
    ambient = 1.0 - strength * float(rng.uniform(0.5, 0.95))
    first = float(rng.uniform(0, 360))
    leds = []
    for number in range(count):
        rgb = np.array(_sample_lamp_rgb(strength, rng)) * (2.0 * (1.0 - ambient) / count)
        reach = float(rng.uniform(0.5, 1.3))
        leds.append(Led(first + 360.0 * number / count + float(rng.uniform(-30, 30)), _rgb(rgb), reach))
    level = ambient * np.array(_temperature_rgb(strength, rng))
    balance = 1.0 - strength * float(rng.uniform(0.0, 1.0))
    development = replace(chain.development, balance=balance)
    return replace(chain, lamps=Light(rgb=_rgb(level), leds=tuple(leds)), development=development)


def _sample_lamp_rgb(strength: float, rng: Rng) -> RGB:
    if rng.random() < 0.5:
        return _temperature_rgb(strength, rng)
    return led_rgb(float(rng.uniform(0, 360)), strength * float(rng.uniform(0.4, 0.95)))


def _temperature_rgb(strength: float, rng: Rng) -> RGB:
    extreme = float(rng.choice((WARMEST_K, COLDEST_K)))
    share = strength * float(rng.uniform(0.5, 1.0))
    temperature_k = float(np.exp((1 - share) * np.log(NEUTRAL_K) + share * np.log(extreme)))
    # daylight of the neutral temperature is white
    relative = np.array(blackbody_rgb(temperature_k)) / np.array(blackbody_rgb(NEUTRAL_K))
    return _rgb(relative / relative.max())


def change_pigments(chain: Chain, strength: float, rng: Rng) -> Chain:
    """Inks as they are made: pigmented silicone, pastel, a dark green, a navy, an orange, fluorescent inks."""
    target = PIGMENTS[int(rng.integers(len(PIGMENTS)))]
    inks = {}
    for item in fields(Inks):
        made, standard = np.array(getattr(target, item.name)), np.array(getattr(chain.inks, item.name))
        inks[item.name] = _rgb(standard + strength * (made - standard))
    return replace(chain, inks=Inks(**inks))


def color_light(chain: Chain, strength: float, rng: Rng) -> Chain:
    """Light of another color, and no white balance.

    A lamp of 2,500 to 15,000 K; one channel with a twentieth of the light; two channels with a fifth; or a red, a green
    and a blue lamp from three sides over a weak white one.
    """
    gain, kind, channel = np.ones(3), int(rng.integers(4)), int(rng.integers(3))
    leds: tuple[Led, ...] = ()
    if kind == 0:
        gain = np.array(_temperature_rgb(strength, rng))
    elif kind == 1:
        gain[channel] = WEAKEST_CHANNEL**strength
    elif kind == 2:
        gain[:] = WEAK_CHANNELS**strength
        gain[channel] = 1.0
    else:
        gain *= 1.0 - strength * float(rng.uniform(0.6, 0.95))
        first, reach = float(rng.uniform(0, 360)), float(rng.uniform(0.6, 1.3))
        leds = tuple(Led(first + 120.0 * k, led_rgb(120.0 * k, strength), reach) for k in range(3))
    development = replace(chain.development, balance=0.0)
    return replace(chain, lamps=Light(rgb=_rgb(gain), leds=leds if strength else ()), development=development)


def change_surround(chain: Chain, strength: float, rng: Rng) -> Chain:
    """White, grey, black, wood-like or skin-like; a weak one is dark."""
    kind, rgb = SURROUNDS[int(rng.integers(len(SURROUNDS)))]
    tinted = np.array(rgb) * rng.uniform(0.8, 1.1, 3)
    mixed = (1.0 - strength) * np.array(chain.surround.rgb) + strength * tinted
    return replace(chain, surround=Surround(kind, _rgb(np.minimum(mixed, 0.95)), strength))


def graded(part: str, name: str, most: float, *, is_signed: bool = False) -> Effect:
    """A field of a part of the chain in proportion to the strength; ``is_signed``: of a random sign."""

    def change(chain: Chain, strength: float, rng: Rng) -> Chain:
        sign = float(rng.choice((-1, 1))) if is_signed else 1.0
        return replace(chain, **{part: replace(getattr(chain, part), **{name: most * sign * strength})})

    return change


def move(chain: Chain, strength: float, rng: Rng) -> Chain:
    """Motion of up to 13 px during the exposure, in any direction."""
    direction_deg = float(rng.uniform(0, 180))
    return replace(chain, lens=replace(chain.lens, motion_px=13.0 * strength, motion_deg=direction_deg))


def change_exposure(chain: Chain, strength: float, rng: Rng) -> Chain:
    """0.1 to 8 times the light that just fits."""
    extreme = float(rng.choice((MIN_EXPOSURE, MAX_EXPOSURE)))
    return replace(chain, sensor=replace(chain.sensor, exposure=extreme**strength))


def add_mosaic(chain: Chain, strength: float, rng: Rng) -> Chain:
    """A Bayer mosaic behind a lens that is the sharper the stronger the effect."""
    if not strength:
        return chain
    methods: tuple[Demosaicing, ...] = ("edge-aware", "bilinear")
    method = methods[int(rng.integers(2))]
    blur_px = SOFT_BLUR_PX + strength * (SHARP_BLUR_PX - SOFT_BLUR_PX)
    sensor = replace(chain.sensor, demosaicing=method, phase=int(rng.integers(4)))
    return replace(chain, sensor=sensor, lens=replace(chain.lens, blur_px=blur_px))


def add_noise(chain: Chain, strength: float, rng: Rng) -> Chain:
    """Shot noise of down to 200 electrons, read noise of up to 12 electrons."""
    sensor = chain.sensor
    electrons = sensor.electrons * (200.0 / sensor.electrons) ** strength
    read_noise = sensor.read_noise + strength * (12.0 - sensor.read_noise)
    return replace(chain, sensor=replace(sensor, electrons=electrons, read_noise=read_noise))


def misbalance(chain: Chain, strength: float, rng: Rng) -> Chain:
    """A white balance whose gains are wrong by factors of up to 1.65 each."""
    error = rng.uniform(-0.5, 0.5, 3) * strength
    return replace(chain, development=replace(chain.development, balance_error=_rgb(error)))


def compress(chain: Chain, strength: float, rng: Rng) -> Chain:
    """JPEG of a quality of 95 down to 15, 4:4:4 or 4:2:0."""
    if not strength:
        return chain
    share = max(strength - FIRST_STRENGTH, 0.0) / (1.0 - FIRST_STRENGTH)
    quality = round(BEST_QUALITY + share * (WORST_QUALITY - BEST_QUALITY))
    return replace(
        chain,
        development=replace(chain.development, jpeg_quality=quality, jpeg_420=bool(rng.random() < 0.5)),
    )


EFFECTS: dict[str, Effect] = {
    "inks": change_inks,
    "pigments": change_pigments,
    "lamps": change_lamps,
    "colored light": color_light,
    "surround": change_surround,
    "shifted colors": graded("pad", "color_shift", 0.1),
    "scattered corners": graded("pad", "corner_scatter_px", 0.5),
    "rounded corners": graded("pad", "rounding", 0.2),
    "bled edges": graded("pad", "bleed", 0.1),
    "defocus": graded("lens", "defocus_px", 4.0),
    "aberration": graded("lens", "aberration_px", 2.0, is_signed=True),
    "bloom": graded("lens", "bloom", 0.2),
    "vignetting": graded("lens", "vignetting", 0.8),
    "distortion": graded("lens", "distortion", 0.15, is_signed=True),
    "motion": move,
    "exposure": change_exposure,
    "mosaic": add_mosaic,
    "noise": add_noise,
    "lifted black": graded("sensor", "lifted_black", MAX_LIFTED),
    "white balance": misbalance,
    "sharpening": graded("development", "sharpening", 2.0),
    "tone mapping": graded("development", "tone_mapping", 0.5),
    "s-curve": graded("development", "s_curve", 1.0),
    "jpeg": compress,
}


COLOR_EFFECTS = ("inks", "pigments", "lamps", "colored light", "surround", "lifted black", "white balance")


def _rgb(values: np.ndarray) -> RGB:
    red, green, blue = (float(value) for value in values)
    return red, green, blue
