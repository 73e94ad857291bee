"""Tiny video files that flash and click at the same moments, and detection of both."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from numpy.typing import NDArray

CLICK_S = 0.004
RATE = 48_000
FPS = 20
CLICKS = (0.3, 0.8, 1.3)
WIDTH, HEIGHT = 64, 32


def click_samples(clicks: Sequence[float], seconds: float, rate: int = RATE) -> NDArray[np.float32]:
    """Return silence (seconds * rate,) float32 with a burst of 2 kHz at each click."""
    time = np.arange(round(seconds * rate)) / rate
    samples = np.zeros_like(time)
    for click in clicks:
        on = (time >= click - 1e-9) & (time < click + CLICK_S)
        samples[on] = 0.7 * np.cos(2.0 * np.pi * 2000.0 * (time[on] - click))
    return samples.astype(np.float32)


def flash_luma(seconds: float, clicks: Sequence[float] = CLICKS) -> int:
    """Return the luma of the picture of that moment."""
    return 200 if any(abs(seconds - click) < 0.5 / FPS for click in clicks) else 30


def write_sounding(
    path: Path,
    *codecs: str,
    clicks: Sequence[float] = CLICKS,
    seconds: float = 2.0,
    begins: float = 0.0,
    ends: float | None = None,
    layout: str = "stereo",
    rate: int = RATE,
) -> Path:
    """Write a file of pictures and of a sound stream for each codec, AAC if there is none.

    Of several streams, each lacks one more of the first clicks.

    Parameters
    ----------
    clicks : sequence of float
        Times of frames, in seconds.
    begins, ends : float
        Start and end of the sound, in seconds.
    """
    with av.open(str(path), "w") as container:
        pictures = container.add_stream("libx264", rate=FPS)
        pictures.width, pictures.height, pictures.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        packets = []
        sounds = [
            container.add_stream(codec, rate=rate, layout=layout) for codec in codecs or ("aac",)
        ]
        for number, stream in enumerate(sounds):
            samples = click_samples(clicks[number:], ends or seconds, rate)[round(begins * rate) :]
            channels = np.tile(samples, (stream.layout.nb_channels, 1))
            heard = av.AudioFrame.from_ndarray(channels, "fltp", layout)
            heard.sample_rate, heard.time_base = rate, Fraction(1, rate)
            heard.pts = round(begins * rate)
            packets += stream.encode(heard) + stream.encode(None)
        for number in range(round(seconds * FPS)):
            luma = np.full((HEIGHT * 3 // 2, WIDTH), 128, np.uint8)
            luma[:HEIGHT] = flash_luma(number / FPS, clicks)
            shown = av.VideoFrame.from_ndarray(luma, format="yuv420p")
            shown.pts, shown.time_base = number, Fraction(1, FPS)
            packets += pictures.encode(shown)
        packets += pictures.encode(None)
        for packet in sorted(packets, key=lambda packet: packet.dts * packet.time_base):
            container.mux(packet)
    return path


def flashes(path: Path) -> list[float]:
    """Return the seconds at which a file's pictures become bright."""
    with av.open(str(path)) as container:
        shown = [
            (frame.time, frame.to_ndarray()[0, 0] > 100) for frame in container.decode(video=0)
        ]
    before = [False, *(bright for _, bright in shown)]
    return [time for (time, bright), was in zip(shown, before, strict=False) if bright and not was]


def clicks_in(path: Path) -> list[float]:
    """Return the seconds at which clicks begin in the first channel of a file's only sound."""
    with av.open(str(path)) as container:
        (stream,) = container.streams.audio
        resampler = av.AudioResampler("fltp")
        loud = []
        for frame in container.decode(stream):
            begins = frame.time
            samples = np.concatenate([p.to_ndarray() for p in resampler.resample(frame)], axis=1)
            loud += list(begins + np.flatnonzero(np.abs(samples[0]) > 0.3) / frame.sample_rate)
    gaps = np.diff(loud, prepend=-1.0)
    return [float(time) for time, gap in zip(loud, gaps, strict=True) if gap > 0.05]


def sound_bytes(path: Path) -> list[bytes]:
    """Return the packets of a file's first sound stream."""
    with av.open(str(path)) as container:
        return [bytes(packet) for packet in container.demux(audio=0) if packet.size]


def sound_codecs(path: Path) -> list[str]:
    """Return FFmpeg's names of the codecs of a file's sound streams."""
    with av.open(str(path)) as container:
        return [each.codec_context.codec.canonical_name for each in container.streams.audio]
