"""Clips of the scenes as files: color as 10-bit HEVC that keeps radiance, depth without loss.

Color is stored as in BT.2100: the PQ curve of SMPTE ST 2084 over luminance, where radiance 1
stands for the reference white of 203 cd/m² (ITU-R BT.2408). So lamps and windows are not clipped,
up to a radiance of 49. Primaries and matrix are Rec.709's, like the scenes' colors.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.files.atomic import replacing
from iprt.output.encode import frame_rate, mux_in_order

WHITE_NITS = 203.0
"""Luminance in cd/m² of radiance 1."""
PQ_NITS = 10_000.0
M1, M2 = 2610 / 16384, 2523 / 4096 * 128
C1, C2, C3 = 3424 / 4096, 2413 / 4096 * 32, 2392 / 4096 * 32
"""Constants of SMPTE ST 2084."""
LUMA = (0.2126, 0.7152, 0.0722)

Image = NDArray[np.float32]


def pq_encode(radiance: Image) -> NDArray[np.float64]:
    """Return values in [0, 1] of linear radiance, by the inverse EOTF of SMPTE ST 2084."""
    share = np.clip(radiance.astype(np.float64) * (WHITE_NITS / PQ_NITS), 0.0, 1.0) ** M1
    return np.asarray(((C1 + C2 * share) / (1.0 + C3 * share)) ** M2)


def ycbcr_10_bit(encoded: NDArray[np.float64]) -> NDArray[np.uint16]:
    """Return planes (3, H, W) of limited-range Y'CbCr by Rec.709's matrix, of R'G'B' (H, W, 3)."""
    red, green, blue = np.moveaxis(encoded, -1, 0)
    kr, kg, kb = LUMA
    luma = kr * red + kg * green + kb * blue
    planes = [
        64.0 + 876.0 * luma,
        512.0 + 896.0 * (blue - luma) / (2.0 * (1.0 - kb)),
        512.0 + 896.0 * (red - luma) / (2.0 * (1.0 - kr)),
    ]
    return np.asarray(np.rint(np.stack(planes)), np.uint16)


def write_color(path: Path, frames: Iterable[Image], *, fps: float, crf: int) -> None:
    """Write linear radiance (H, W, 3) as 10-bit HEVC with full chroma, at quality `crf`."""
    tags = "colorprim=bt709:transfer=smpte2084:colormatrix=bt709:range=limited"
    options = {"preset": "slow", "crf": str(crf), "x265-params": f"{tags}:log-level=none"}
    planes = (ycbcr_10_bit(pq_encode(frame)) for frame in frames)
    _write(path, "libx265", "yuv444p10le", planes, fps, options)


def write_depth(path: Path, frames: Iterable[Image], *, fps: float, scale: float) -> None:
    """Write depth (H, W) in units of `scale` metres as FFV1, 16 bits; 0 where there is none."""
    # Version 3 with the range coder and its large contexts: the smallest files.
    options = {"level": "3", "coder": "range_tab", "context": "1", "slices": "4"}
    planes = (np.rint(frame / scale).astype(np.uint16)[None] for frame in frames)
    _write(path, "ffv1", "gray16le", planes, fps, options)


def _write(
    path: Path,
    codec: str,
    layout: str,
    pictures: Iterable[NDArray[np.uint16]],
    fps: float,
    options: dict[str, str],
) -> None:
    import av

    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as temporary, av.open(str(temporary), "w", format="matroska") as file:
        stream: Any = None
        packets: list[Any] = []
        rate = frame_rate(fps)
        for number, planes in enumerate(pictures):
            _, height, width = planes.shape
            if stream is None:
                stream = file.add_stream(codec, rate)
                stream.width, stream.height, stream.pix_fmt = width, height, layout
                stream.options = options
            frame = av.VideoFrame(width, height, layout)
            for plane, values in zip(frame.planes, planes, strict=True):
                rows = np.zeros((height, plane.line_size // 2), "<u2")
                rows[:, :width] = values
                plane.update(rows.tobytes())
            frame.pts, frame.time_base = number, 1 / rate
            packets += stream.encode(frame)
        mux_in_order(file, packets + stream.encode(None))
