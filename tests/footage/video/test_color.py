"""Colors of video files, against the formulas of the standards written out anew, in float64."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.footage.video.color import linear_color
from iprt.footage.video.container import video_streams
from iprt.footage.video.pixel_planes import layout
from iprt.footage.video.reader import open_streams
from tests.footage.video.encoding import Track, video_frame, write_video

Float = NDArray[np.float64]
HERE = Path("v.mkv")
ALL = slice(0, 16)
SIZE = (16, 32)

# Chromaticities of red, green and blue; white is D65 but where it is named.
REC709 = ((0.64, 0.33), (0.30, 0.60), (0.15, 0.06))
REC2020 = ((0.708, 0.292), (0.170, 0.797), (0.131, 0.046))
P3 = ((0.680, 0.320), (0.265, 0.690), (0.150, 0.060))
PRIMARIES = {1: REC709, 9: REC2020, 12: P3}
WEIGHTS = {1: (0.2126, 0.7152, 0.0722), 6: (0.299, 0.587, 0.114), 9: (0.2627, 0.6780, 0.0593)}


def to_xyz(primaries: tuple[tuple[float, float], ...]) -> Float:
    columns = np.array([[x / y, 1.0, (1 - x - y) / y] for x, y in primaries]).T
    white = np.array([0.3127 / 0.3290, 1.0, (1 - 0.3127 - 0.3290) / 0.3290])
    return columns * np.linalg.solve(columns, white)


def srgb(e: Float) -> Float:
    return np.where(e <= 0.0031308, 12.92 * e, 1.055 * np.abs(e) ** (1 / 2.4) - 0.055)


def pq(light: Float) -> Float:
    """The code of multiples of reference white."""
    y = (light * 203.0 / 10000.0) ** 0.1593017578125
    return ((0.8359375 + 18.8515625 * y) / (1 + 18.6875 * y)) ** 78.84375


def hlg(light: Float) -> Float:
    """The code for multiples of reference white, through the inverse OOTF for 1000 cd/m2."""
    display = light * 203.0 / 1000.0
    luminance = (display @ np.array(WEIGHTS[9]))[..., None]
    scene = np.where(luminance > 0, display * np.maximum(luminance, 1e-30) ** ((1 - 1.2) / 1.2), 0)
    log = 0.17883277 * np.log(np.maximum(12 * scene - 0.28466892, 1e-9)) + 0.55991073
    return np.where(scene <= 1 / 12, np.sqrt(3 * scene), log)


TRANSFERS = {
    1: lambda e: e ** (1 / 2.4),
    4: lambda e: e ** (1 / 2.2),
    8: lambda e: e,
    13: srgb,
    14: lambda e: e ** (1 / 2.4),
    16: pq,
    18: hlg,
}


def picture(seed: int = 0) -> Float:
    """(16, 32, 3) linear Rec.709 colors, constant in cells of 4 x 4."""
    cells = np.random.default_rng(seed).uniform(0.15, 0.85, (4, 8, 3))
    cells[0, 0], cells[0, 1] = 1.0, 0.0
    return np.repeat(np.repeat(cells, 4, axis=0), 4, axis=1)


def coded(linear: Float, transfer: int, primaries: int) -> Float:
    """Non-linear R'G'B' in other primaries."""
    matrix = np.linalg.solve(to_xyz(PRIMARIES[primaries]), to_xyz(REC709))
    return np.asarray(TRANSFERS[transfer](np.maximum(linear @ matrix.T, 0.0)))


def ycc(rgb: Float, matrix: int, bits: int, full: bool) -> list[NDArray[np.integer]]:
    """Integer Y, Cb, Cr (ITU-R BT.709, BT.601 and BT.2020, item 3)."""
    r, g, b = WEIGHTS[matrix]
    y = rgb @ np.array([r, g, b])
    cb, cr = (rgb[..., 2] - y) / (2 * (1 - b)), (rgb[..., 0] - y) / (2 * (1 - r))
    if full:
        top = 2**bits - 1
        planes = [y * top, cb * top + 2 ** (bits - 1), cr * top + 2 ** (bits - 1)]
    else:
        planes = [(219 * y + 16), (224 * cb + 128), (224 * cr + 128)]
        planes = [plane * 2 ** (bits - 8) for plane in planes]
    kind = np.uint8 if bits == 8 else np.dtype("<u2")
    return [np.clip(np.rint(plane), 0, 2**bits - 1).astype(kind) for plane in planes]


def halved(planes: list[NDArray[np.integer]], pixels: str) -> list[NDArray[np.integer]]:
    """Chroma of cells at the size that the format stores."""
    across = 1 if "444" in pixels else 2
    down = 2 if "420" in pixels else 1
    return [planes[0], *(plane[::down, ::across] for plane in planes[1:])]


def inside(found: NDArray[np.float32]) -> NDArray[np.float32]:
    """The texels whose chroma is not interpolated between cells, in any layout."""
    return found.reshape(4, 4, 8, 4, 3)[:, 1:3, :, :3]


CASES = [
    (matrix, transfer, primaries, bits, full)
    for matrix, transfer, primaries in ((6, 1, 1), (1, 1, 1), (1, 13, 1), (9, 14, 9), (1, 13, 12),
                                        (9, 16, 9), (9, 18, 9), (1, 4, 1), (1, 8, 1))
    for bits, full in itertools.product((8, 10, 12, 16), (False, True))
    if (bits > 8 or transfer not in (8, 16, 18)) and (bits in (8, 10) or transfer in (1, 16))
]  # fmt: skip


@pytest.mark.parametrize(("matrix", "transfer", "primaries", "bits", "full"), CASES)
def test_colors_are_those_of_the_standard(
    matrix: int, transfer: int, primaries: int, bits: int, full: bool
) -> None:
    linear = picture(bits + transfer)
    rgb = coded(linear, transfer, primaries)
    pixels = "yuv444p" if bits == 8 else f"yuv444p{bits}le"
    tags = {
        "colorspace": matrix,
        "color_trc": transfer,
        "color_primaries": primaries,
        "color_range": 2 if full else 1,
    }
    frame = video_frame(pixels, list(ycc(rgb, matrix, bits, full)), tags)
    found = linear_color(frame, ALL, HERE)
    assert found.dtype == np.float32
    # What a rounding of Y, Cb and Cr by half a step, and of the table, can make of the light.
    step = 2.5 / (2**bits * (1.0 if full else 0.856)) + 2e-5
    slack = np.zeros_like(rgb)
    matrix_back = np.linalg.solve(to_xyz(REC709), to_xyz(PRIMARIES[primaries]))
    for sign in (-1, 1):
        moved = decoded(np.clip(rgb + sign * step, 0.0, 1.0), transfer)
        slack = np.maximum(slack, np.abs(moved - decoded(np.clip(rgb, 0, 1), transfer)))
    allowed = slack @ np.abs(matrix_back).T + 1e-4
    assert (np.abs(found - linear) <= allowed).all()
    assert allowed.max() < {8: 0.12, 10: 0.12, 12: 0.03, 16: 0.01}[bits]


def decoded(rgb: Float, transfer: int) -> Float:
    """Light of R'G'B', by inverting a finely sampled curve; of HLG, by its formula."""
    if transfer == 18:
        scene = np.where(
            rgb <= 0.5, rgb**2 / 3, (np.exp((rgb - 0.55991073) / 0.17883277) + 0.28466892) / 12
        )
        luminance = (scene @ np.array(WEIGHTS[9]))[..., None]
        return np.asarray(scene * luminance**0.2 * 1000 / 203)
    light = np.concatenate([np.linspace(0, 1e-3, 5000), np.geomspace(1e-3, 60.0, 20000)])
    return np.asarray(np.interp(rgb, TRANSFERS[transfer](light), light))


def test_reference_white_is_one() -> None:
    """BT.2408: PQ at 58%, HLG at 75% of the signal."""
    white = np.ones((2, 4, 3))
    for transfer, signal in ((16, 0.5807), (18, 0.75)):
        assert coded(white, transfer, 9).mean() == pytest.approx(signal, abs=1e-3)
        planes = ycc(np.full((2, 4, 3), signal), 9, 12, False)
        tags = {"colorspace": 9, "color_trc": transfer, "color_primaries": 9, "color_range": 1}
        frame = video_frame("yuv444p12le", planes, tags)
        found = linear_color(frame, slice(0, 2), HERE)
        assert found == pytest.approx(1.0, rel=6e-3)


@pytest.mark.parametrize(
    ("pixels", "bits"),
    [("yuv420p", 8), ("yuv422p", 8), ("nv12", 8), ("yuyv422", 8), ("yuva420p", 8),
     ("yuv420p10le", 10), ("p010le", 10), ("yuv422p10le", 10), ("yuv422p12le", 12)],
)  # fmt: skip
def test_every_layout_holds_the_same_colors(pixels: str, bits: int) -> None:
    linear = picture(5)
    planes = ycc(coded(linear, 13, 1), 1, bits, False)
    tags = {"colorspace": 1, "color_trc": 13, "color_primaries": 1, "color_range": 1}
    straight = video_frame("yuv444p" if bits == 8 else f"yuv444p{bits}le", list(planes), tags)
    stored = halved(planes, "420" if pixels in ("nv12", "p010le") else pixels)
    frame = video_frame(pixels, packed(pixels, stored), tags, SIZE)
    found, expected = linear_color(frame, ALL, HERE), linear_color(straight, ALL, HERE)
    assert np.abs(inside(found) - inside(expected)).max() < 1e-6


def packed(pixels: str, planes: list[NDArray[np.integer]]) -> list[NDArray[np.integer]]:
    """Planes as the format lays them out."""
    y, u, v = planes
    if pixels == "yuva420p":
        return [y, u, v, np.full_like(y, 7)]
    if pixels in ("nv12", "p010le"):
        shift = 6 if pixels == "p010le" else 0
        pairs = np.stack([u, v], axis=-1).reshape(u.shape[0], -1)
        return [y << shift, pairs << shift]
    if pixels == "yuyv422":
        quads = np.stack([y[:, ::2], u, y[:, 1::2], v], axis=-1)
        return [quads.reshape(y.shape[0], -1)]
    return planes


def test_chroma_is_interpolated_across_the_seam() -> None:
    """A cosine around the panorama, stored at every other column, comes back everywhere."""
    turn = np.arange(64) / 64 * 2 * np.pi
    u = np.broadcast_to(128 + 80 * np.cos(turn), (32, 64))
    planes = [np.full((32, 64), 110, np.uint8), np.rint(u[::2, ::2]).astype(np.uint8),
              np.full((16, 32), 128, np.uint8)]  # fmt: skip
    tags = {"color_trc": 8, "colorspace": 1, "color_range": 1}
    blue = linear_color(video_frame("yuv420p", planes, tags), slice(0, 32), HERE)[..., 2]
    expected = (110 - 16) / 219 + 1.8556 * (u - 128) / 224
    assert np.abs(blue - expected).max() < 0.006


@pytest.mark.parametrize(
    "pixels", ["rgb24", "gbrp", "bgra", "gbrp10le", "gbrp12le", "gbrp16le", "rgb48le"]
)
def test_rgb_is_read_as_it_is(pixels: str) -> None:
    how = layout(pixels)
    assert how is not None
    rgb = np.random.default_rng(1).integers(0, 2**how.bits, (*SIZE, 3))
    kind = np.uint8 if how.bits == 8 else np.dtype("<u2")
    if pixels.startswith("gbr"):
        planes = [rgb[..., channel].astype(kind) for channel in (1, 2, 0)]
    elif pixels == "bgra":
        planes = [np.concatenate([rgb[..., ::-1], rgb[..., :1]], axis=-1).astype(kind)]
    else:
        planes = [rgb.astype(kind)]
    found = linear_color(video_frame(pixels, planes), ALL, HERE)
    e = rgb / (2**how.bits - 1)
    expected = np.where(e <= 0.04045, e / 12.92, ((e + 0.055) / 1.055) ** 2.4)
    assert np.abs(found - expected).max() < 3e-5


@pytest.mark.parametrize("pixels", ["gbrpf32le", "grayf32le"])
def test_floats_are_linear_unless_tagged(pixels: str) -> None:
    values = np.random.default_rng(1).uniform(0, 50, (*SIZE, 3)).astype("<f4")
    order = (1, 2, 0) if pixels == "gbrpf32le" else (0,)
    frame = video_frame(pixels, [values[..., channel] for channel in order])
    expected = values if pixels == "gbrpf32le" else np.repeat(values[..., :1], 3, axis=-1)
    assert np.array_equal(linear_color(frame, ALL, HERE), expected)
    frame.color_trc = 1
    assert linear_color(frame, ALL, HERE).max() <= 1.0


@pytest.mark.parametrize(
    ("width", "height", "matrix"), [(32, 16, 6), (1024, 512, 6), (1280, 640, 1), (4096, 2048, 1)]
)
def test_untagged_streams(width: int, height: int, matrix: int) -> None:
    """sRGB, limited, and the matrix that players take for pictures of the size."""
    color = np.array([0.7, 0.3, 0.2])
    planes = [
        np.full((height, width), plane, np.uint8)
        for plane in ycc(srgb(color)[None, None], matrix, 8, False)
    ]
    chroma = [plane[::2, ::2] for plane in planes[1:]]
    frame = video_frame("yuv420p", [planes[0], *chroma])
    found = linear_color(frame, slice(0, 2), HERE)
    assert np.abs(found - color).max() < 0.01


@pytest.mark.parametrize(
    ("tags", "message"),
    [({"colorspace": 8}, "color matrix 8"), ({"color_trc": 9}, "transfer characteristics 9"),
     ({"color_primaries": 10}, "color primaries 10")],
)  # fmt: skip
def test_what_is_not_read_is_named(tags: dict[str, int], message: str) -> None:
    planes = [np.full(SIZE, 128, np.uint8)] * 3
    with pytest.raises(FormatError, match=f"v.mkv: {message} .ITU-T H.273. not supported"):
        linear_color(video_frame("yuv444p", planes, tags), ALL, HERE)
    assert layout("bayer_bggr8") is None
    assert layout("xyz12le") is None


@pytest.mark.parametrize(
    ("codec", "pixels", "file"),
    [("libx264", "yuv444p10le", "v.mp4"), ("libx265", "yuv444p12le", "v.mkv"),
     ("ffv1", "yuv444p10le", "v.mkv"), ("prores_ks", "yuv444p10le", "v.mov")],
)  # fmt: skip
def test_tags_survive_their_way_through_a_file(
    codec: str, pixels: str, file: str, tmp_path: Path
) -> None:
    bits = int(pixels[7:9])
    linear = np.full((64, 64, 3), (0.8, 0.35, 0.2))
    tags = {"colorspace": 9, "color_trc": 16, "color_primaries": 9, "color_range": 1}
    planes = ycc(coded(linear, 16, 9), 9, bits, False)
    options = {"libx264": {"qp": "1"}, "libx265": {"x265-params": "log-level=none:qp=1"}}
    write_video(
        tmp_path / file, Track(codec, pixels, [planes], options=options.get(codec, {}), tags=tags)
    )
    (info,) = video_streams(tmp_path / file)
    with open_streams() as streams:
        found = linear_color(streams(info).at(info.start), slice(0, 64), info.path)
    assert np.abs(found - linear).max() < 0.02
