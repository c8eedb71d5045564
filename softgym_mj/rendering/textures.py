"""Procedural textures."""

import functools
import io
from collections.abc import Sequence

import mujoco
import numpy as np
from dm_control import mjcf
from PIL import Image

from softgym_mj.rendering.look import Color, Look
from softgym_mj.rendering.patterns import pattern, second_tone

# Weave: variation between threads and darkening where a thread passes under another, relative to
# the color. With more variation cloth looks like a bamboo mat.
TONE, RELIEF = 0.02, 0.22
HEM, HEM_SHADE = 0.018, 0.86  # Width of the hem relative to a side, and factor of its color.
STITCHES, STITCH = 90, 0.72  # Stitches along a side, and factor of the hem's color.
# Range along the rows of a sheet, relative to their length, of the strip that distinguishes the
# halves of a cloth.
STRIP = (0.125, 0.181)
PAD = 0.02  # Margin of a panel, relative to its side, so that mipmaps do not mix panels.
STRAND_SHADE = 0.55  # Factor of the color of a rope between its strands.
PLASTER = 0.006  # Relative color variation of plaster; above 1 % it looks like clouds.
SHINE_THROUGH = 0.4  # Relative strength of a print on the other side.
ROWS = 32  # Rows of a weave computed together, which fit into a processor's cache.
KEPT = 8  # Cache size per kind: a texture takes some megabytes, and random ones never recur.


def asset(pixels: np.ndarray) -> mjcf.Asset:
    """Returns an image (height, width, 3) uint8 as an asset file of a model."""
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "png", compress_level=1)
    return mjcf.Asset(file.getvalue(), ".png")


def texture_of(model: mujoco.MjModel, material: int) -> np.ndarray | None:
    """Returns the colors (height, width, 3) uint8 of a material's 2D texture, or None."""
    if material < 0:
        return None
    number = model.mat_texid[material, mujoco.mjtTextureRole.mjTEXROLE_RGB]
    if number < 0 or model.tex_type[number] != mujoco.mjtTexture.mjTEXTURE_2D:
        return None
    shape = model.tex_height[number], model.tex_width[number], model.tex_nchannel[number]
    first = model.tex_adr[number]
    return model.tex_data[first : first + np.prod(shape)].reshape(shape)[..., :3]


def _noise(random: np.random.Generator, size: int, octaves: Sequence[int]) -> np.ndarray:
    """Returns smooth, tileable noise (size, size) of variance 1."""
    frequency = np.fft.fftfreq(size) * size
    total = np.zeros((size, size))
    for octave in octaves:
        # At higher frequencies the spectrum is below 1e-16.
        along = np.arange(min(4 * octave + 1, size // 2 + 1))
        radius = np.hypot(frequency[:, None], along)
        spectrum = np.exp(-(((radius - octave) / (0.5 * octave)) ** 2))
        waves = np.fft.rfft(random.standard_normal((size, size)))[:, : len(along)]
        waves = np.fft.ifft(np.fft.fft(waves, axis=0) * spectrum, axis=0)
        part = np.fft.irfft(waves, size)
        total += part / part.std()
    return total / total.std()


def _pixels(colors: np.ndarray) -> np.ndarray:
    """Returns colors in 0..255 (height, width, 3) uint8 of colors in 0..1, which it overwrites."""
    np.clip(colors, 0.0, 1.0, out=colors)
    colors *= 255.0
    return np.rint(colors, out=colors).astype(np.uint8)


@functools.lru_cache(maxsize=KEPT)
def weave(
    look: Look,
    colors: tuple[Color, Color],
    has_strip: bool,
    print_name: str = "plain",
    seed: int = 0,
) -> mjcf.Asset:
    """Returns the texture of both sides of a woven sheet with a hem, the first on the left half.

    Args:
        look: Level of detail.
        colors: Colors of the two sides.
        has_strip: Whether a strip along the rows, at `STRIP`, has the other side's color.
        print_name: Print on the first side, one of `patterns.FABRICS`.
        seed: Seed of the threads' tones and the print.
    """
    size, threads = look.texture_size, look.threads
    random = np.random.Generator(np.random.PCG64(seed))
    place = (np.arange(size) + 0.5) / size
    place = (place - PAD) / (1.0 - 2.0 * PAD)  # 0..1 within the sheet.
    thread = np.floor(place * threads).astype(int)
    within = np.sin(np.pi * (place * threads - thread))  # 1 at a thread's center.
    tones = [1.0 + TONE * random.standard_normal(threads + 8)[thread % threads] for _ in range(2)]
    edge, dashes = np.minimum(place, 1.0 - place), (place * STITCHES) % 1.0 < 0.6
    strip = (has_strip & (place >= STRIP[0]) & (place < STRIP[1]))[:, None]
    inks = None if print_name == "plain" else pattern(print_name, seed, place, place)[..., None]
    sides = (*colors, 1.0), (*colors[::-1], SHINE_THROUGH)
    pixels = np.empty((size, 2 * size, 3), np.uint8)
    for first in range(0, size, ROWS):
        rows = slice(first, first + ROWS)
        across, along = within[rows, None], within[None, :]
        is_warp = (thread[rows, None] + thread[None, :]) % 2 == 0  # Whether the warp is on top.
        relief = np.where(is_warp, along * (0.6 + 0.4 * across), across * (0.6 + 0.4 * along))
        shade = 1.0 - RELIEF * (1.0 - relief)
        shade *= np.where(is_warp, tones[0], tones[1][rows, None])
        rim = np.minimum(edge[rows, None], edge[None, :])
        shade = np.where(rim < HEM, HEM_SHADE * shade, shade)
        running = np.where(edge[rows, None] < edge[None, :], dashes[None, :], dashes[rows, None])
        seam = (np.abs(rim - HEM) < 0.12 * HEM) & running
        shade = np.where(seam, STITCH * shade, shade)
        for panel, (own, other, strength) in enumerate(sides):
            color = np.where(strip, np.array(other), np.array(own))[None]
            if inks is not None:
                ink = np.where(strip, 0.0, strength * inks[rows])
                color = color + ink * (second_tone(np.array(own), seed) - color)
            columns = slice(panel * size, (panel + 1) * size)
            pixels[rows, columns] = _pixels(shade[..., None] * color)
    return asset(pixels)


@functools.lru_cache(maxsize=KEPT)
def strands(
    look: Look, color: Color, lobes: int, pattern_name: str = "plain", seed: int = 0
) -> mjcf.Asset:
    """Returns the texture around (left to right) and along a rope: fibers, darker between strands.

    Args:
        look: Level of detail.
        color: Color of the rope.
        lobes: Number of strands.
        pattern_name: One of `patterns.ROPES`.
        seed: Seed of the pattern.
    """
    around = (np.arange(look.texture_size) + 0.5) / look.texture_size
    fibres = around[:, None] * 24.0 + around[None, :] * 3.0 * lobes
    shade = 1.0 - 0.10 * (0.5 - 0.5 * np.cos(2.0 * np.pi * fibres))
    if look.is_stranded:
        depth = 0.5 + 0.5 * np.cos(2.0 * np.pi * lobes * around)  # 1 on top of a strand.
        shade = shade * (STRAND_SHADE + (1.0 - STRAND_SHADE) * np.sqrt(depth)[None, :])
    tones = np.array(color)
    if pattern_name != "plain":
        ink = pattern(pattern_name, seed, around, around)[..., None]
        tones = tones + ink * (second_tone(tones, seed) - tones)
    return asset(_pixels(shade[..., None] * tones))


@functools.lru_cache(maxsize=KEPT)
def plaster(size: int, color: Color, seed: int = 0) -> mjcf.Asset:
    """Returns a tileable matte surface of one tone."""
    random = np.random.Generator(np.random.PCG64(seed))
    noise = _noise(random, size, [3, 9, 27])
    return asset(_pixels((1.0 + PLASTER * noise)[..., None] * np.array(color)))


@functools.lru_cache(maxsize=KEPT)
def wood(size: int, color: Color, seed: int = 0) -> mjcf.Asset:
    """Returns tileable planed boards along X."""
    random = np.random.Generator(np.random.PCG64(seed))
    boards = 4
    y = np.arange(size) / size
    noise = _noise(random, size, [2, 5])
    shade = np.empty((size, size))
    for board in range(boards):
        rows = slice(board * size // boards, (board + 1) * size // boards)
        part = np.roll(noise, random.integers(size, size=2), (0, 1))[rows]
        grain = np.sin(2 * np.pi * (14.0 * (y[rows, None] - y[rows][0]) + 0.35 * part))
        fine = _noise(random, size, [size // 6])[rows].mean(axis=1, keepdims=True)
        shade[rows] = 1.0 + 0.025 * grain + 0.03 * random.standard_normal() + 0.01 * fine
    joint = (np.arange(size) % (size // boards)) < max(size // 256, 1)
    shade = np.where(joint[:, None], 0.8 * shade, shade)
    return asset(_pixels(shade[..., None] * np.array(color)))


@functools.lru_cache(maxsize=KEPT)
def granite(size: int, color: Color, seed: int = 0) -> mjcf.Asset:
    """Returns tileable speckled stone."""
    random = np.random.Generator(np.random.PCG64(seed))
    noise = _noise(random, size, [size // 10, size // 5])
    shade = 1.0 - 0.15 * np.clip(noise - 0.6, 0.0, 1.5) + 0.08 * np.clip(-noise - 1.0, 0.0, 1.0)
    return asset(_pixels(shade[..., None] * np.array(color)))


@functools.lru_cache(maxsize=KEPT)
def tiles(size: int, color: Color, seed: int = 0) -> mjcf.Asset:
    """Returns square tiles with joints, each in its own tone."""
    random = np.random.Generator(np.random.PCG64(seed))
    number = int(random.integers(4, 9))
    place = number * (np.arange(size) + 0.5) / size
    tones = 1.0 + 0.03 * random.standard_normal((number, number))
    shade = tones[np.ix_(place.astype(int), place.astype(int))]
    joint = (place % 1.0) < 0.05
    shade = np.where(joint[:, None] | joint[None, :], 0.7, shade)
    return asset(_pixels(shade[..., None] * np.array(color)))


@functools.lru_cache(maxsize=KEPT)
def printed(size: int, color: Color, seed: int = 0, *, name: str) -> mjcf.Asset:
    """Returns a tileable smooth surface with one of `patterns.FABRICS`."""
    place = 2.0 * (np.arange(size) + 0.5) / size
    ink = pattern(name, seed, place, place)[..., None]
    return asset(_pixels(np.array(color) + ink * (second_tone(np.array(color), seed) - color)))
