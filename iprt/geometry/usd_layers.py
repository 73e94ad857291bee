"""The layers of a USD file, each checked before USD opens it.

USD opens every file that a layer names, anywhere, as soon as it composes a stage. So the layers
are opened one by one here, and their references checked, before there is a stage.
"""

from __future__ import annotations

import posixpath
from pathlib import Path
from typing import Any

from pxr import Sdf, Usd, UsdUtils

from iprt.errors import FormatError
from iprt.files.message_text import printable
from iprt.files.safe_reading import is_file, reference_beside, require_inside
from iprt.geometry.usd_data import USD_SUFFIXES

MAX_LAYERS = 4096
CLIPS = ("clips", "clipSets")
"""Metadata that makes USD open further files when values are read."""


class Layers:
    """The layers of a USD file, which lie in its folder.

    Parameters
    ----------
    root : Path
        The file.
    within : Path
        Folder that must hold all layers, with links resolved.
    shown : Path
        Name of the file in errors.

    Attributes
    ----------
    stage : Usd.Stage
    others : list of str
        Layers other than the file, relative to its folder.
    has_clips : bool
        True if some layer has value clips, which are left out.

    Raises
    ------
    FormatError
        A layer is missing, damaged or outside of the folder.
    """

    def __init__(self, root: Path, within: Path, shown: Path) -> None:
        # Without a delegate, USD prints its warnings.
        self._delegate = UsdUtils.CoalescingDiagnosticDelegate()
        self._folder, self._within, self.shown = root.parent, within, shown
        self._names: dict[str, str] = {}
        self._opened: list[Any] = []
        self.others: list[str] = []
        self.has_clips = False
        self._open(root.name)
        waiting = list(self._opened)
        while waiting:
            layer = waiting.pop()
            # References to prims of the same layer have no name.
            for written in filter(None, layer.GetCompositionAssetDependencies()):
                name = self._layer_name(layer, written)
                if name not in self._names.values():
                    waiting.append(self._open(name))
                    self.others.append(name)
        self.stage = Usd.Stage.Open(self._opened[0])
        used = {layer.identifier for layer in self.stage.GetUsedLayers() if not layer.anonymous}
        if not used <= self._names.keys():
            raise FormatError(f"{shown}: refers to layers outside its folder; copy them in")

    def beside(self, layer: Any, written: str) -> str:
        """Return the name, relative to the file's folder, of a file that a layer refers to.

        Raises
        ------
        FormatError
            The file is outside of the folder, or on the net.
        """
        own = posixpath.dirname(self._names[layer.identifier])
        path = written.replace("\\", "/")
        # Colons are in drives, addresses and arguments; backticks in expressions.
        if path.startswith("/") or ":" in path or "`" in path:
            reference_beside(self.shown, path)
            raise FormatError(
                f"{self.shown}: refers to {printable(written)}, which is no plain file name"
            )
        return str(reference_beside(self.shown, posixpath.normpath(posixpath.join(own, path))))

    def _layer_name(self, layer: Any, written: str) -> str:
        name = self.beside(layer, written)
        if posixpath.splitext(name)[1].lower() not in USD_SUFFIXES[:-1]:
            kinds = ", ".join(USD_SUFFIXES[:-1])
            raise FormatError(
                f"{self.shown}: refers to {printable(written)}; only {kinds} are read there"
            )
        return name

    def _open(self, name: str) -> Any:
        path = self._folder / name
        if not is_file(path):
            raise FormatError(
                f"{self.shown}: refers to {printable(name)}, which is missing beside it"
            )
        require_inside(path, self._within)
        if len(self._opened) == MAX_LAYERS:
            raise FormatError(f"{self.shown}: refers to more than {MAX_LAYERS} layers")
        layer = Sdf.Layer.FindOrOpen(str(path))
        if layer is None:
            raise ValueError(f"{printable(name)} cannot be opened")
        self._opened.append(layer)
        self._names[layer.identifier] = name
        layer.SetPermissionToSave(False)
        layer.Traverse(Sdf.Path.absoluteRootPath, lambda path: self._without_clips(layer, path))
        return layer

    def _without_clips(self, layer: Any, path: Any) -> None:
        spec = layer.GetObjectAtPath(path)
        for key in CLIPS if isinstance(spec, Sdf.PrimSpec) else ():
            if spec.HasInfo(key):
                spec.ClearInfo(key)
                self.has_clips = True
