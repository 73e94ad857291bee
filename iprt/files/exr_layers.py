"""Layers of an EXR file, and the choice among them by name.

Channels are named `layer.channel`, in multi-part files also by the part. A 3D program writes
`ViewLayer.Combined.R`, `ViewLayer.Depth.Z`, `ViewLayer.Normal.X`, and many more passes.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from iprt.errors import FormatError
from iprt.files.exr_header import Part
from iprt.files.message_text import printable

_TRIPLES = ("RGB", "XYZ")
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")
_DEPTH = frozenset(_WORD.findall("depth z zdepth distance dist"))
_NORMAL = frozenset(_WORD.findall("normal normals nrm n"))
_PICTURE = frozenset(
    _WORD.findall("beauty c ci color colour combined composite final image main master rgb rgba")
)
_OTHER = frozenset(
    # Passes as 3D programs name them, and pictures other than the beauty pass.
    _WORD.findall(
        "albedo ambient ambientocclusion ao back base coverage crypto cryptomatte denoising diff "
        "diffuse dir emission emit env environment gloss glossy id ind index indirect mask matte "
        "mist motion noisy normalized occlusion p position pos reflection refraction shadow "
        "shadows spec specular sss subsurface trans transmission uv vector velocity volume"
    )
)


@dataclass(frozen=True)
class Layer:
    """Channels of an EXR file that form one picture: three that belong together, or one.

    Attributes
    ----------
    name : str
        Part and prefix of the channels; for a single channel also the channel: `beauty`,
        `beauty.Z`. RGB or XYZ for three channels without part and prefix.
    prefix : str
        Part and prefix alone; may be empty.
    letters : str
        RGB, XYZ, or the last component of a single channel's name.
    channels : tuple of str
        Full names of the channels in the file.
    part : int
        Index of the part.
    """

    name: str
    prefix: str
    letters: str
    channels: tuple[str, ...]
    part: int

    @property
    def is_single(self) -> bool:
        """True for a single channel."""
        return len(self.channels) == 1

    @property
    def meaning(self) -> str:
        """Kind by the words of the name: picture, depth, normals or other; "" if unknown."""
        # Earlier components name a part of the scene or an eye.
        last = self.prefix.rpartition(".")[2]
        found = _WORD.findall(f"{last}.{self.letters}" if self.is_single else last)
        words = [word.lower() for word in found]
        if self.letters.lower() in ("a", "alpha") or not _OTHER.isdisjoint(words):
            return "other"
        if not self.is_single and not _NORMAL.isdisjoint(words):
            return "normals"
        if self.letters != "XYZ" and not _DEPTH.isdisjoint(words):
            return "depth"
        if self.letters == "RGB" and (not words or words[-1] in _PICTURE):
            return "picture"
        return ""


def layers_of(parts: Sequence[Part]) -> list[Layer]:
    """Return the layers of a file, sorted by part and name."""
    layers: list[Layer] = []
    for number, part in enumerate(parts):
        groups: dict[str, dict[str, str]] = {}
        for channel in sorted(part.channels):
            # Some renderers start channel names with a dot.
            prefix, _, letters = channel.rpartition(".")
            groups.setdefault(_joined(part.name, prefix.strip(".")), {})[letters] = channel
        for prefix, channels in groups.items():
            layers += _layers_in(prefix, channels, number)
    return layers


def _layers_in(prefix: str, channels: dict[str, str], part: int) -> Iterable[Layer]:
    rest = dict(channels)
    for triple in _TRIPLES:
        for letters in (triple, triple.lower()):
            if all(letter in rest for letter in letters):
                names = tuple(rest.pop(letter) for letter in letters)
                yield Layer(prefix or triple, prefix, triple, names, part)
                break
    for letters, channel in rest.items():
        yield Layer(f"{prefix}.{letters}".strip("."), prefix, letters, (channel,), part)


def _joined(part: str, prefix: str) -> str:
    """Join the name of a part and the prefix of its channels, which often repeats it."""
    if not part or prefix == part or prefix.startswith(f"{part}."):
        return prefix
    if not prefix or part.endswith(f".{prefix}"):
        return part
    return f"{part}.{prefix}"


def color_layer(path: Path, layers: Sequence[Layer], wanted: str | None) -> Layer:
    """Return the layer that is the picture.

    The order of preference is: channels R, G, B without a layer; layers named as a picture; layers
    with an unknown name; luminance Y.

    Parameters
    ----------
    path : Path
        Name of the file in errors.
    wanted : str or None
        Name of the layer to take.

    Raises
    ------
    FormatError
        There is none, or several are possible.
    """
    if wanted is not None:
        return _named(path, layers, wanted, "color")
    triples = [layer for layer in layers if layer.letters == "RGB"]
    tiers: list[Callable[[Layer], bool]] = [
        lambda layer: layer.letters == "RGB" and not layer.prefix,
        lambda layer: layer.meaning == "picture",
        lambda layer: layer.letters == "RGB" and not layer.meaning,
        lambda layer: layer.letters == "Y" and not layer.meaning,
    ]
    for tier in tiers:
        if found := [layer for layer in layers if tier(layer)]:
            return _only(path, found, "the picture", "color")
    if triples:
        raise _undecided(path, triples, "no layer is the picture by its name", "color")
    raise FormatError(f"{path}: no channels R, G, B or Y; the file has {_channels(layers)}")


def depth_layer(path: Path, layers: Sequence[Layer], wanted: str | None) -> Layer:
    """Return the layer that is depth, by its name or as the only candidate.

    Parameters and errors are as in `color_layer`.
    """
    if wanted is not None:
        return _named(path, layers, wanted, "depth")
    if found := named_depth(layers):
        return _only(path, found, "depth", "depth")
    possible = [layer for layer in layers if layer.meaning in ("", "picture")]
    possible = [layer for layer in possible if layer.letters != "XYZ"]
    if possible:
        return _only(path, possible, "depth", "depth")
    if any(layer.is_single or layer.letters == "RGB" for layer in layers):
        raise _undecided(path, layers, "no layer is depth by its name", "depth")
    raise FormatError(f"{path}: no channel of depth; the file has {_channels(layers)}")


def normal_layer(path: Path, layers: Sequence[Layer]) -> Layer:
    """Return the layer of normals, by its name or as the only one of three channels.

    Raises
    ------
    FormatError
        There is none, or several are possible.
    """
    triples = [layer for layer in layers if not layer.is_single]
    found = [layer for layer in triples if layer.meaning == "normals"]
    found = found or [layer for layer in triples if layer.meaning != "other"]
    if not found:
        raise FormatError(
            f"{path}: no channels R, G, B or X, Y, Z of normals; the file has {_channels(layers)}"
        )
    if len(found) > 1:
        raise FormatError(
            f"{path}: several layers could be normals: {_names(found)}; save one of them alone"
        )
    return found[0]


def named_depth(layers: Sequence[Layer]) -> list[Layer]:
    """Return the layers named as depth; single channels take precedence over three."""
    found = [layer for layer in layers if layer.meaning == "depth"]
    singles = [layer for layer in found if layer.is_single]
    plain = [layer for layer in singles if not layer.prefix]
    # Among depth of several eyes or layers, the one without a layer belongs to the main picture.
    if len(plain) == 1 and all(layer.letters == plain[0].letters for layer in singles):
        return plain
    return singles or found


def _named(path: Path, layers: Sequence[Layer], wanted: str, key: str) -> Layer:
    """Return the layer of a name, or the only one of a prefix such as `ViewLayer.Depth`."""
    found = [layer for layer in layers if layer.name == wanted] or [
        layer
        for layer in layers
        if layer.prefix == wanted and layer.letters.lower() not in ("a", "alpha")
    ]
    if not found:
        raise FormatError(
            f"{path}: --{key}-layer {printable(wanted)}: no such layer; the file has "
            f"{_names(layers)}"
        )
    return _only(path, found, key, key)


def _only(path: Path, found: Sequence[Layer], what: str, key: str) -> Layer:
    if len(found) > 1:
        raise _undecided(path, found, f"several layers could be {what}", key)
    return found[0]


def _undecided(path: Path, layers: Sequence[Layer], why: str, key: str) -> FormatError:
    return FormatError(
        f"{path}: {why}: {_names(layers)}; name one: --{key}-layer NAME ({key}_layer in scene.toml)"
    )


def _names(layers: Sequence[Layer]) -> str:
    return printable(", ".join(layer.name for layer in layers))


def _channels(layers: Sequence[Layer]) -> str:
    return printable(", ".join(sorted(name for layer in layers for name in layer.channels)))
