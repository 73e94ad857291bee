"""Sound of the source's video file, from the film's first frame on.

Films keep real time at any frame rate, so the sound fits as it is. Its packets are copied where the
film's container takes them, and otherwise decoded and re-encoded.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from itertools import chain
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.footage.video.container import ffmpeg_decoding, opened, stamp_of, time_base
from iprt.output.spatial_media import track_box

LOG = logging.getLogger("iprt.render")

COPIED = {
    "mp4": ("aac", "ac3", "alac", "eac3", "flac", "mp3", "opus"),
    "mov": ("aac", "ac3", "alac", "eac3", "mp3", "pcm"),
    "matroska": ("aac", "ac3", "alac", "dts", "eac3", "flac", "mp3", "opus", "pcm", "vorbis"),
}
"""FFmpeg's name of a container -> codecs that it and its players support; "pcm" is any PCM."""
ENCODERS = {"mp4": "aac", "mov": "aac", "matroska": "flac"}
"""Container -> encoder for sound that is not copied."""
BITS_A_SECOND = 128_000
"""Bit rate per channel of lossy encoders."""
LAYOUTS = {1: "mono", 2: "stereo", 4: "4.0", 6: "5.1", 8: "7.1"}
"""Number of channels -> layout given to encoders where the channels have no names."""
COMMON_RATE = 48_000
"""Samples a second where the encoder does not take the source's rate."""
BEFORE_S = Fraction(8, 100)
"""Seconds of sound that decoders need before the first correct sample; Opus needs the most."""
LONGEST_S = {"mp4": Fraction(1, 8), "mov": Fraction(1, 8), "matroska": Fraction(1, 20)}
"""Container -> longest copied packet: films end between two, and Matroska's begin there, too."""
JITTER_S = Fraction(1, 100)
"""Largest offset at which decoded samples follow the previous ones without a gap."""


@dataclass(frozen=True)
class Sound:
    """Part of a video file's sound that belongs to a film.

    Attributes
    ----------
    path : Path
    start : Fraction
        Time of the film's first frame, in seconds on the file's clock.
    length : Fraction
        Duration of the film in seconds.
    """

    path: Path
    start: Fraction
    length: Fraction


def sound_stream(source: Any, path: Path) -> Any:
    """Return the default sound stream of an open video file, else the first; None without sound.

    Raises
    ------
    FormatError
        FFmpeg knows the codec of no stream.
    """
    streams = source.streams.audio
    known = [stream for stream in streams if stream.codec_context is not None]
    if streams and not known:
        raise FormatError(f"{path}: its sound is of an unknown codec")
    first = known[0] if known else None
    return next((each for each in known if "default" in str(each.disposition).lower()), first)


def ambisonic_box(sound: Sound) -> bytes:
    """Return the box of spatial audio metadata; empty if the source has none.

    Raises
    ------
    FormatError
        The source cannot be read.
    """
    with opened(sound.path) as source:
        stream = sound_stream(source, sound.path)
        number = None if stream is None else source.streams.audio.index(stream)
    return b"" if number is None else track_box(sound.path, number)


def sound_packets(container: Any, kind: str, sound: Sound) -> Iterator[Any]:
    """Add a sound stream to a file that is being written, and yield its packets in order.

    The stream is added with the first packet; without sound at that time, there is neither.

    Parameters
    ----------
    container : av.container.OutputContainer
    kind : str
        FFmpeg's name of the container.

    Raises
    ------
    FormatError
        The sound cannot be read.
    """
    with (
        opened(sound.path) as source,
        ffmpeg_decoding(sound.path, "its sound cannot be read"),
    ):
        stream = sound_stream(source, sound.path)
        if stream is None:
            return
        if (number := len(source.streams.audio)) > 1:
            place = source.streams.audio.index(stream) + 1
            LOG.info("%s: has %d streams of sound; number %d is kept", sound.path, number, place)
        packets = _packets(source, stream, sound)
        first = next(packets, None)
        if first is None:
            return
        packets = chain([first], packets)
        length = (first.duration or 0) * time_base(stream)
        if length <= LONGEST_S[kind] and _takes(container, kind, stream.codec_context):
            track = container.add_stream_from_template(stream)
            yield from _copied(packets, stream, track, sound, kind)
        else:
            track = _encoder(container, kind, stream.codec_context)
            yield from _encoded(packets, track, sound)


def _takes(container: Any, kind: str, context: Any) -> bool:
    """Return whether a container and its players take a codec."""
    name = context.codec.canonical_name
    family = "pcm" if name.startswith("pcm_") else name
    return family in COPIED[kind] and name in container.supported_codecs


def _packets(source: Any, stream: Any, sound: Sound) -> Iterator[Any]:
    """Yield packets from `BEFORE_S` before the film to its end; none if all come before it."""
    import av

    base = time_base(stream)
    early = sound.start - BEFORE_S
    ahead: list[Any] = []
    if early > Fraction(stream.start_time or 0) * base:
        with suppress(av.FFmpegError):
            source.seek(int(early / base), stream=stream)
    for packet in source.demux(stream):
        begin = stamp_of(packet)
        if begin is None:
            continue
        if begin * base >= sound.start + sound.length:
            break
        end = (begin + (packet.duration or 0)) * base
        if end > early:
            ahead.append(packet)
        if end > sound.start:
            yield from ahead
            ahead.clear()


def _copied(
    packets: Iterable[Any], stream: Any, track: Any, sound: Sound, kind: str
) -> Iterator[Any]:
    """Yield packets at the film's times, without a last one that is mostly heard after it.

    MP4 and QuickTime files say where a track begins to be heard, so packets that decoders need come
    before that. A Matroska file begins with its first packet, so that has to be the film's first.
    """
    base = time_base(stream)
    shift, end = round(sound.start / base), round(sound.length / base)
    context = stream.codec_context
    last = None
    if kind == "matroska":
        last = -1 - ceil(Fraction(context.delay, context.sample_rate) / base)
    for packet in packets:
        begin = stamp_of(packet) - shift  # type: ignore[operator]  # none without one
        duration = packet.duration or 0
        if (last is not None and begin <= last) or 2 * begin + duration > 2 * end:
            continue
        packet.pts = packet.dts = last = begin
        packet.duration = min(duration, end - begin)
        packet.stream = track
        yield packet


def _encoder(container: Any, kind: str, context: Any) -> Any:
    """Add a stream with the channels and, if the encoder can, the rate of a decoder."""
    import av

    name = ENCODERS[kind]
    rates = av.Codec(name, "w").audio_rates
    rate = context.sample_rate
    layout = context.layout.name
    if layout.endswith("channels") or layout.startswith("ambisonic"):
        layout = LAYOUTS.get(context.channels, layout)
    track = container.add_stream(
        name, rate=rate if rates is None or rate in rates else COMMON_RATE, layout=layout
    )
    if name == "aac":
        track.bit_rate = BITS_A_SECOND * context.channels
    else:
        track.format = "s32"
    return track


def _encoded(packets: Iterable[Any], track: Any, sound: Sound) -> Iterator[Any]:
    """Decode packets, cut them to the film's samples, and yield them re-encoded."""
    import av

    rate = track.sample_rate
    done = 0
    for samples in _samples(packets, track, sound):
        frame = av.AudioFrame.from_ndarray(samples, "fltp", track.layout)
        frame.sample_rate, frame.time_base, frame.pts = rate, Fraction(1, rate), done
        done += samples.shape[1]
        yield from track.encode(frame)
    yield from track.encode(None)


def _samples(packets: Iterable[Any], track: Any, sound: Sound) -> Iterator[NDArray[np.float32]]:
    """Yield the film's samples without a gap, (channels, n) float32; n is at most some seconds.

    Raises
    ------
    FormatError
        No packet can be decoded.
    """
    import av

    rate = track.sample_rate
    end = round(sound.length * rate)
    resampler = av.AudioResampler("fltp", track.layout, rate)
    done = 0
    heard = False
    for frame in _decoded(packets):
        heard = True
        begin = round((frame.pts * frame.time_base - sound.start) * rate)
        named = _named(frame, track.layout)
        parts = [each.to_ndarray() for each in resampler.resample(named)]
        if not parts:
            continue
        samples = np.concatenate(parts, axis=1, dtype=np.float32)
        gap = begin - done
        if done and abs(gap) <= JITTER_S * rate:
            gap = 0
        while gap > 0 and done < end:
            silence = np.zeros((len(samples), min(gap, rate, end - done)), np.float32)
            yield silence
            done, gap = done + silence.shape[1], gap - silence.shape[1]
        samples = samples[:, max(-gap, 0) :][:, : end - done]
        if samples.size:
            yield samples
            done += samples.shape[1]
    if not heard:
        raise FormatError(f"{sound.path}: its sound is damaged")


def _named(frame: Any, layout: Any) -> Any:
    """Return the frame with its channels renamed, so that the resampler mixes none of them."""
    import av

    if frame.layout.name == layout.name:
        return frame
    named = av.AudioFrame.from_ndarray(frame.to_ndarray(), frame.format.name, layout.name)
    named.sample_rate, named.time_base, named.pts = frame.sample_rate, frame.time_base, frame.pts
    return named


def _decoded(packets: Iterable[Any]) -> Iterator[Any]:
    """Decode packets, and yield the undamaged frames that have a time stamp."""
    import av

    for packet in packets:
        with suppress(av.FFmpegError):
            for frame in packet.decode():
                if frame.pts is not None:
                    yield frame
