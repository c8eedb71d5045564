"""Textures, made of numbers and a seed."""

import functools
import io
from collections.abc import Sequence

import mujoco
import numpy as np
from dm_control import mjcf

from softgym_mj.rendering.look import Color, Look
from softgym_mj.rendering.patterns import pattern, second_tone

# Of the weave, as parts of the colour: how much one thread differs from the next, and how dark it
# is where it dives under another. With more of the first, cloth looks like a mat of bamboo.
TONE, RELIEF = 0.02, 0.22
HEM, HEM_SHADE = 0.018, 0.86  # Width of the hem as part of a side, factor to its colour.
STITCHES, STITCH = 90, 0.72  # Along a side; factor to the hem's colour.
# Along the rows of a sheet, as parts of them: where the texture has the strip that tells the halves
# of a cloth apart. A cloth of any size is fitted to it.
STRIP = (0.125, 0.181)
PAD = 0.02  # Part of a panel around its picture, so that small ones do not mix with the next.
STRAND_SHADE = 0.55  # Factor to the colour of a rope between its strands.
PLASTER = 0.006  # Part of its colour by which plaster varies; above 1 % it looks like clouds.
SHINE_THROUGH = 0.4  # How strong a printed pattern is on the other side.
KEPT = 8  # Textures of a kind that are kept, of up to some megabytes: random ones never come again.


def asset(pixels: np.ndarray) -> mjcf.Asset:
    """An image (height, width, 3) uint8 as a file of a model's."""
    import imageio.v3 as imageio

    file = io.BytesIO()
    imageio.imwrite(file, pixels, extension=".png", compress_level=1)
    return mjcf.Asset(file.getvalue(), ".png")


def texture_of(model: mujoco.MjModel, material: int) -> np.ndarray | None:
    """The colours (height, width, 3) uint8 of a material's texture, if it has a flat one."""
    if material < 0:
        return None
    number = model.mat_texid[material, mujoco.mjtTextureRole.mjTEXROLE_RGB]
    if number < 0 or model.tex_type[number] != mujoco.mjtTexture.mjTEXTURE_2D:
        return None
    shape = model.tex_height[number], model.tex_width[number], model.tex_nchannel[number]
    first = model.tex_adr[number]
    return model.tex_data[first : first + np.prod(shape)].reshape(shape)[..., :3]


def _noise(random: np.random.Generator, size: int, octaves: Sequence[int]) -> np.ndarray:
    """Smooth noise (size, size) that goes on beyond its edges, of variance 1."""
    frequency = np.fft.fftfreq(size) * size
    radius = np.hypot(*np.meshgrid(frequency, frequency))
    total = np.zeros((size, size))
    for octave in octaves:
        spectrum = np.exp(-(((radius - octave) / (0.5 * octave)) ** 2))
        waves = np.fft.fft2(random.standard_normal((size, size))) * spectrum
        part = np.fft.ifft2(waves).real
        total += part / part.std()
    return total / total.std()


def _pixels(colors: np.ndarray) -> np.ndarray:
    return np.round(255.0 * np.clip(colors, 0.0, 1.0)).astype(np.uint8)


@functools.lru_cache(maxsize=KEPT)
def weave(
    look: Look,
    colors: tuple[Color, Color],
    has_strip: bool,
    print_name: str = "plain",
    seed: int = 0,
) -> mjcf.Asset:
    """Both sides of a woven sheet with a hem, the first one on the left half.

    Args:
        look: how fine it is.
        colors: of the two sides.
        has_strip: whether a strip along the rows, at `STRIP`, has the other side's colour, plain.
        print_name: what is printed on the first side, one of `patterns.FABRICS`.
        seed: of the threads' tones and the print.
    """
    size, threads = look.texture_size, look.threads
    random = np.random.Generator(np.random.PCG64(seed))
    place = (np.arange(size) + 0.5) / size
    place = (place - PAD) / (1.0 - 2.0 * PAD)  # 0..1 within the sheet.
    thread = np.floor(place * threads).astype(int)
    within = np.sin(np.pi * (place * threads - thread))  # 0 at the sides of a thread, 1 amid it.
    across, along = within[:, None], within[None, :]
    is_warp = (thread[:, None] + thread[None, :]) % 2 == 0  # Is it the warp that lies on top?
    relief = np.where(is_warp, along * (0.6 + 0.4 * across), across * (0.6 + 0.4 * along))
    tones = [1.0 + TONE * random.standard_normal(threads + 8)[thread % threads] for _ in range(2)]
    shade = (1.0 - RELIEF * (1.0 - relief)) * np.where(is_warp, tones[0], tones[1][:, None])
    edge = np.minimum(place, 1.0 - place)
    rim = np.minimum(edge[:, None], edge[None, :])
    shade = np.where(rim < HEM, HEM_SHADE * shade, shade)
    dashes = (place * STITCHES) % 1.0 < 0.6
    running = np.where(edge[:, None] < edge[None, :], dashes[None, :], dashes[:, None])
    seam = (np.abs(rim - HEM) < 0.12 * HEM) & running
    shade = np.where(seam, STITCH * shade, shade)
    strip = has_strip & (place >= STRIP[0]) & (place < STRIP[1])
    panels = []
    for own, other, strength in ((*colors, 1.0), (*colors[::-1], SHINE_THROUGH)):
        color = np.where(strip[:, None], np.array(other), np.array(own))[None]
        if print_name != "plain":
            ink = strength * pattern(print_name, seed, place, place)[..., None]
            ink = np.where(strip[:, None], 0.0, ink)
            color = color + ink * (second_tone(np.array(own), seed) - color)
        panels.append(shade[..., None] * color)
    return asset(_pixels(np.concatenate(panels, axis=1)))


@functools.lru_cache(maxsize=KEPT)
def strands(
    look: Look, color: Color, lobes: int, pattern_name: str = "plain", seed: int = 0
) -> mjcf.Asset:
    """Around a rope (left to right) and along it: darker between the strands, with fibres.

    Args:
        look: how fine it is.
        color: of the rope.
        lobes: number of strands.
        pattern_name: one of `patterns.ROPES`.
        seed: of the pattern.
    """
    around = (np.arange(look.texture_size) + 0.5) / look.texture_size
    fibres = around[:, None] * 24.0 + around[None, :] * 3.0 * lobes
    shade = 1.0 - 0.10 * (0.5 - 0.5 * np.cos(2.0 * np.pi * fibres))
    if look.is_stranded:
        depth = 0.5 + 0.5 * np.cos(2.0 * np.pi * lobes * around)  # 1 on top of a strand.
        shade = shade * (STRAND_SHADE + (1.0 - STRAND_SHADE) * np.sqrt(depth)[None, :])
    ink = pattern(pattern_name, seed, around, around)[..., None]
    tones = np.array(color) + ink * (second_tone(np.array(color), seed) - np.array(color))
    return asset(_pixels(shade[..., None] * tones))


@functools.lru_cache(maxsize=KEPT)
def plaster(size: int, color: Color, seed: int = 0) -> mjcf.Asset:
    """A matt surface of one tone, the same at its opposite edges."""
    random = np.random.Generator(np.random.PCG64(seed))
    noise = _noise(random, size, [3, 9, 27])
    return asset(_pixels((1.0 + PLASTER * noise)[..., None] * np.array(color)))


@functools.lru_cache(maxsize=KEPT)
def wood(size: int, color: Color, seed: int = 0) -> mjcf.Asset:
    """Planed boards along X, the same at their opposite edges."""
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
    """Speckled stone, the same at its opposite edges."""
    random = np.random.Generator(np.random.PCG64(seed))
    noise = _noise(random, size, [size // 10, size // 5])
    shade = 1.0 - 0.15 * np.clip(noise - 0.6, 0.0, 1.5) + 0.08 * np.clip(-noise - 1.0, 0.0, 1.0)
    return asset(_pixels(shade[..., None] * np.array(color)))


@functools.lru_cache(maxsize=KEPT)
def tiles(size: int, color: Color, seed: int = 0) -> mjcf.Asset:
    """Square tiles with joints, each of its own tone."""
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
    """A smooth surface with one of `patterns.FABRICS` on it, the same at its opposite edges."""
    place = 2.0 * (np.arange(size) + 0.5) / size
    ink = pattern(name, seed, place, place)[..., None]
    return asset(_pixels(np.array(color) + ink * (second_tone(np.array(color), seed) - color)))
