"""The sound of the source's video file, from the moment of a film's first frame on.

Films keep real time whatever their frame rate, so the sound fits as it is. Its packets are copied
where the film's container takes them; else they are decoded and encoded anew.
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
from iprt.output.ambisonics import track_box

LOG = logging.getLogger("iprt.render")

COPIED = {
    "mp4": ("aac", "ac3", "alac", "eac3", "flac", "mp3", "opus"),
    "mov": ("aac", "ac3", "alac", "eac3", "mp3", "pcm"),
    "matroska": ("aac", "ac3", "alac", "dts", "eac3", "flac", "mp3", "opus", "pcm", "vorbis"),
}
"""FFmpeg's name of a container -> codecs that it and those who play it take; all kinds of PCM."""
ENCODERS = {"mp4": "aac", "mov": "aac", "matroska": "flac"}
"""Container -> encoder of sound that is not copied."""
BITS_A_SECOND = 128_000
"""Of each channel, where the encoder loses anything."""
LAYOUTS = {1: "mono", 2: "stereo", 4: "4.0", 6: "5.1", 8: "7.1"}
"""Number of channels -> what encoders are told that they are where they have no names."""
COMMON_RATE = 48_000
"""Samples a second where the encoder does not take the source's."""
BEFORE_S = Fraction(8, 100)
"""Seconds of sound that decoders need to hear before the first sample they get right: Opus most."""
LONGEST_S = {"mp4": Fraction(1, 8), "mov": Fraction(1, 8), "matroska": Fraction(1, 20)}
"""Container -> how long packets may be: films end between two, and Matroska's begin there, too."""
JITTER_S = Fraction(1, 100)
"""Decoded samples that are off by no more follow those before them without a gap."""


@dataclass(frozen=True)
class Sound:
    """The part of a video file's sound that belongs to a film.

    Attributes
    ----------
    path : Path
    start : Fraction
        When the film's first frame is shown, in seconds on the file's clock.
    length : Fraction
        Seconds of film.
    """

    path: Path
    start: Fraction
    length: Fraction


def sound_stream(source: Any, path: Path) -> Any:
    """The stream of sound of an open video file that is kept: its default. None: it has none.

    Raises
    ------
    FormatError
        FFmpeg knows none of their codecs.
    """
    streams = source.streams.audio
    known = [stream for stream in streams if stream.codec_context is not None]
    if streams and not known:
        raise FormatError(f"{path}: its sound is of an unknown codec")
    first = known[0] if known else None
    return next((each for each in known if "default" in str(each.disposition).lower()), first)


def ambisonic_box(sound: Sound) -> bytes:
    """The box that tells players of sound from all around; empty where the source has none.

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
    """Add a stream of sound to a file that is being written, and make its packets, in order.

    The stream is added with the first packet; there is neither where the source has no sound then.

    Parameters
    ----------
    container : av.container.OutputContainer
    kind : str
        FFmpeg's name of the container.

    Raises
    ------
    FormatError
        It cannot be read.
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
    """Whether a container, and those who play it, take a codec."""
    name = context.codec.canonical_name
    family = "pcm" if name.startswith("pcm_") else name
    return family in COPIED[kind] and name in container.supported_codecs


def _packets(source: Any, stream: Any, sound: Sound) -> Iterator[Any]:
    """The packets from `BEFORE_S` before the film to its end, in order; none if all come before."""
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
    """The packets at the film's times, without a last one of which most is heard after it.

    MP4 and QuickTime files say from where on a track is heard, so what decoders need comes before
    that; a Matroska file begins with its first packet, which therefore is the first of the film.
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
    """A stream of the channels and, where the encoder can, the rate of a decoder."""
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
    """What packets hold, cut to the film's samples, encoded anew."""
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
    """The film's samples without a gap, (channels, n) float32; n is at most some seconds' worth.

    Raises
    ------
    FormatError
        Nothing can be decoded.
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
    """The frame with its channels renamed, so that the resampler mixes none of them."""
    import av

    if frame.layout.name == layout.name:
        return frame
    named = av.AudioFrame.from_ndarray(frame.to_ndarray(), frame.format.name, layout.name)
    named.sample_rate, named.time_base, named.pts = frame.sample_rate, frame.time_base, frame.pts
    return named


def _decoded(packets: Iterable[Any]) -> Iterator[Any]:
    """The frames that are not damaged and say when they are heard."""
    import av

    for packet in packets:
        with suppress(av.FFmpegError):
            for frame in packet.decode():
                if frame.pts is not None:
                    yield frame
