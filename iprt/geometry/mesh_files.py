"""Files of a mesh and their references, read and checked before trimesh sees them.

trimesh ignores missing textures and unknown contents without a message, and trusts the sizes that a
file declares. This module finds and reports these cases first.
"""

from __future__ import annotations

import base64
import binascii
import json
import struct
from collections.abc import Collection
from io import BytesIO
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from iprt.errors import FormatError
from iprt.files.images import open_picture
from iprt.files.message_text import printable
from iprt.files.safe_reading import (
    MAX_BYTES,
    decoding,
    is_file,
    read_bytes,
    reference_beside,
    require_inside,
)
from iprt.geometry.gltf_check import (
    accessor_of,
    check_gltf,
    require_uncompressed,
)
from iprt.geometry.gltf_document import Accessor, Gltf, parsed_gltf
from iprt.geometry.mesh_text import lines_of, material_maps, ply_textures, without_options
from iprt.geometry.mesh_unread import unread_gltf, unread_obj, unread_ply
from iprt.geometry.ply_check import check_ply
from iprt.geometry.stl_check import check_stl, checked_stl_text, has_colors
from iprt.geometry.usd_data import USD_SUFFIXES
from iprt.geometry.usd_file import UsdFile

MESH_SUFFIXES = (".ply", ".obj", ".stl", ".gltf", ".glb", *USD_SUFFIXES)
MAX_MATERIALS = 4096
MAX_MATERIALS_TIMES_VERTICES = 2**32
"""Limit for an OBJ file: trimesh visits all vertices for each material."""
MAX_JSON_BYTES = 2**27
"""Limit for a glTF document, which takes a multiple of its size in memory."""
LONGEST_NAME = 255
"""Limit for the length of a file name in common file systems."""
_GLTF_SUFFIXES = (".gltf", ".glb")


class MeshFile:
    """A mesh file with the files that it refers to; no other files are read.

    Parameters
    ----------
    path : Path
        .ply, .obj, .stl, .gltf, .glb, .usd, .usda, .usdc or .usdz.
    within : Path or None
        Folder that must hold all files, with links resolved. By default the mesh's own folder, in
        which the mesh itself may be a link.

    Attributes
    ----------
    suffix : str
        File suffix with the dot, in lower case.
    gltf : Gltf or None
        The document of a glTF file, else None.
    usd : UsdFile or None
        The contents of a USD file, else None.
    references : dict of str to Path
        Paths of buffers, layers, material libraries and textures by their name in the file,
        relative to its folder.

    Raises
    ------
    FormatError
        The file is missing, damaged or too large, or a referenced file is missing or outside the
        folder.
    """

    def __init__(self, path: Path, within: Path | None = None) -> None:
        self.path, self.suffix = path, path.suffix.lower()
        self._within = path.parent if within is None else within
        self._read: dict[Path, bytes] = {}
        self._decoded: dict[str, bytes] = {}
        self.gltf: Gltf | None = None
        self.usd: UsdFile | None = None
        self._gltf_chunk = b""
        self._missing_libraries: list[str] = []
        self._ply_elements: list[str] = []
        self.references: dict[str, Path] = {}
        if self.suffix not in MESH_SUFFIXES:
            raise FormatError(f"{path}: not a PLY, OBJ, STL, glTF, GLB or USD file (by its suffix)")
        if not is_file(path):
            raise FormatError(f"{path}: no such mesh file")
        if within is not None:
            require_inside(path, within)
        self.data = read_bytes(path, MAX_JSON_BYTES if self.suffix == ".gltf" else MAX_BYTES)
        if self.suffix == ".ply":
            self._ply_elements = check_ply(path, self.data)
        if self.suffix == ".stl":
            check_stl(path, self.data)
        kind = "glTF" if self.suffix in _GLTF_SUFFIXES else self.suffix[1:].upper()
        kind = "USD" if self.suffix in USD_SUFFIXES else kind
        with decoding(path, f"cut off or damaged {kind} file"):
            self._look_inside()

    def get(self, name: str) -> bytes:
        """Return the contents of a referenced file, by the name that trimesh read.

        Raises
        ------
        FileNotFoundError
            The mesh refers to no such file.
        """
        for known in (name.strip(), without_options(name.strip())):
            if known in self.references:
                return self._contents(self.references[known])
        raise FileNotFoundError(name)

    __getitem__ = get

    def readable_data(self) -> bytes:
        """Return the contents of a PLY, OBJ or STL file, rewritten for trimesh.

        OBJ loses its comments and STL the names of its solids, because trimesh takes format
        keywords in them for statements.
        """
        if self.suffix == ".obj":
            lines = BytesIO(self.data)
            return b"".join(line for line in lines if not line.lstrip().startswith(b"#"))
        return checked_stl_text(self.data) if self.suffix == ".stl" else self.data

    def buffer(self, number: int) -> bytes:
        """Return the contents of a glTF buffer, which may be shorter than declared."""
        assert self.gltf is not None
        uri = self.gltf.buffers[number].uri
        return self._gltf_chunk if uri is None else self._uri_bytes(uri)

    def values(
        self,
        index: int,
        types: Collection[str],
        where: str,
        *,
        finite: bool = True,
        fractions: bool = False,
    ) -> NDArray[np.float64]:
        """Return the data of a glTF accessor; normalised integers become fractions.

        See Khronos glTF 2.0, sections 3.6.2 and 3.11.

        Parameters
        ----------
        types : collection of str
            Allowed glTF types.
        where : str
            Referring part of the document, for error messages.
        finite : bool
            Refuse NaN and infinity.
        fractions : bool
            Take any integers for fractions.

        Returns
        -------
        (count, columns) float64
            Matrices are rows of 16, column-major.

        Raises
        ------
        ValueError
            The accessor has another type, is missing, exceeds its buffer or is not finite.
        """
        assert self.gltf is not None
        accessor = accessor_of(self.gltf, index, types, where)
        dtype, values = accessor.dtype, self._stored(accessor, where)
        if (replaced := accessor.replaced()) is not None:
            rows, others = (self._stored(part, where) for part in replaced)
            if rows.max() >= accessor.count:
                raise ValueError(f"{where}: replaces elements that do not exist")
            values[rows.astype(np.int64).ravel()] = others
        if (accessor.normalized or fractions) and dtype.kind in "iu":
            values = np.maximum(values / np.iinfo(dtype).max, -1.0)
        if finite and not np.isfinite(values).all():
            raise ValueError(f"{where}: holds NaN or infinity")
        return values

    def _stored(self, accessor: Accessor, where: str) -> NDArray[np.float64]:
        """Return the stored elements (count, columns) of an accessor."""
        assert self.gltf is not None
        dtype = accessor.dtype
        shape = accessor.count, accessor.item_bytes // dtype.itemsize
        if accessor.buffer_view is None:
            return np.zeros(shape)
        # `check_gltf` has checked that accessors lie in views, and views in declared buffers.
        view = self.gltf.buffer_views[accessor.buffer_view]
        data = self.buffer(view.buffer)
        if view.byte_offset + view.byte_length > len(data):
            raise ValueError(f"{where}: buffer {view.buffer} is cut off")
        start, step = view.byte_offset + accessor.byte_offset, view.byte_stride
        steps = (step or accessor.item_bytes, dtype.itemsize)
        return np.ndarray(shape, dtype, data, start, steps).astype(np.float64)

    def picture(self, number: int) -> Image.Image:
        """Open an image of a glTF file lazily.

        Raises
        ------
        FormatError, ValueError
            The image is unreadable, or it is nowhere.
        """
        assert self.gltf is not None
        image = self.gltf.images[number]
        if image.uri is not None:
            data = self._uri_bytes(image.uri)
        elif image.buffer_view is not None:
            view = self.gltf.buffer_views[image.buffer_view]
            data = self.buffer(view.buffer)[view.byte_offset : view.byte_offset + view.byte_length]
        else:
            raise ValueError(f"images[{number}]: neither uri nor bufferView")
        return open_picture(
            BytesIO(data), self.path.with_name(f"{self.path.name}:images[{number}]")
        )

    def usd_picture(self, name: str) -> Image.Image:
        """Open a texture of a USD file lazily, by its name relative to the file's folder.

        Raises
        ------
        FormatError
            The picture is unreadable.
        """
        assert self.usd is not None
        if self.usd.packed is not None:
            return open_picture(BytesIO(self.usd.texture(name)), Path(f"{self.path}:{name}"))
        file = self.references[name]
        return open_picture(BytesIO(self._contents(file)), self.path.parent / file)

    def unread_parts(self, *, animated: bool = False) -> list[str]:
        """Return the unread contents of the file, one phrase each, in a fixed order.

        With `animated`, one animation of a glTF file counts as read.
        """
        if self.gltf is not None:
            return list(unread_gltf(self.gltf, animated=animated))
        if self.usd is not None:
            return self.usd.contents.unread
        if self.suffix == ".obj":
            return unread_obj(lines_of(self.data))
        if self.suffix == ".stl":
            return ["colors of triangles"] if has_colors(self.data) else []
        return unread_ply(self._ply_elements)

    def warnings(self) -> list[str]:
        """Return a line for each missing file of materials."""
        return [
            f"refers to {name}, which is missing beside it; its materials are grey"
            for name in dict.fromkeys(self._missing_libraries)
        ]

    def _look_inside(self) -> None:
        if self.suffix in _GLTF_SUFFIXES:
            document, self._gltf_chunk = self._document()
            self.gltf = parsed_gltf(document)
            require_uncompressed(self.path, self.gltf)
            check_gltf(self.gltf)
            for uri in self.gltf.uris():
                if not uri.startswith("data:"):
                    self._refer(uri, unquote(uri))
            for number in self.gltf.read_images():
                self.picture(number)
        elif self.suffix in USD_SUFFIXES:
            self._refer_from_usd()
        elif self.suffix == ".obj":
            self._refer_from_obj()
        elif self.suffix == ".ply":
            for name in ply_textures(self.data):
                self._refer(name, name)
                self._check_texture(name)

    def _document(self) -> tuple[Any, bytes]:
        """Return the JSON of a glTF file, and the binary chunk of a .glb."""
        if self.suffix == ".gltf":
            return json.loads(self.data), b""
        magic, version, whole = struct.unpack_from("<4sII", self.data)
        if magic != b"glTF" or version != 2:
            raise ValueError("no header of glTF 2")
        if whole != len(self.data):
            raise ValueError(f"{len(self.data)} of {whole} bytes")
        chunks, at = [], 12
        while at < whole:
            length, kind = struct.unpack_from("<I4s", self.data, at)
            chunks.append((kind, self.data[at + 8 : at + 8 + length]))
            at += 8 + length
        if at != whole or not chunks or chunks[0][0] != b"JSON":
            raise ValueError("its chunks do not fill it")
        if len(chunks[0][1]) > MAX_JSON_BYTES:
            raise ValueError(f"a document of more than {MAX_JSON_BYTES} bytes")
        binary = [data for kind, data in chunks[1:] if kind == b"BIN\0"]
        return json.loads(chunks[0][1]), binary[0] if binary else b""

    def _refer_from_obj(self) -> None:
        materials, vertices = set(), 0
        for line in lines_of(self.data):
            key, _, rest = line.partition(" ")
            if key == "v":
                vertices += 1
            if key == "usemtl":
                materials.add(rest)
            if key == "mtllib":
                library = rest.strip()
                if not self._refer_to_library(library):
                    continue
                for name in material_maps(self._contents(self.references[library])):
                    self._refer(name, name)
                    self._check_texture(name)
        count = len(materials)
        if count > MAX_MATERIALS or count * vertices > MAX_MATERIALS_TIMES_VERTICES:
            raise ValueError(
                f"{count} materials of {vertices} vertices take too long to read; merge materials, "
                "or split the file"
            )

    def _refer_from_usd(self) -> None:
        self.usd = UsdFile(self.path, self.data, self._within)
        contents, packed = self.usd.contents, self.usd.packed
        if packed is None:
            for name in (*contents.layers, *contents.textures):
                self._refer(name, name)
        for name in contents.textures:
            if packed is not None and name not in packed:
                raise FormatError(f"{self.path}: refers to {printable(name)}, which is not in it")
            self.usd_picture(name)

    def _refer_to_library(self, name: str) -> bool:
        """Add a reference to an MTL file and return True, or note that the file is missing.

        A name that no file can have means a damaged mesh file, not a missing library.
        """
        possible = name.isprintable() and len(name) <= LONGEST_NAME
        if possible and not is_file(self.path.parent / reference_beside(self.path, name)):
            self._missing_libraries.append(printable(name))
            return False
        self._refer(name, name)
        return True

    def _refer(self, written: str, name: str) -> None:
        relative = reference_beside(self.path, name)
        file = self.path.parent / relative
        if not is_file(file):
            name = printable(name)
            raise FormatError(f"{self.path}: refers to {name}, which is missing beside it")
        require_inside(file, self._within)
        self.references[written] = relative

    def _contents(self, relative: Path) -> bytes:
        if relative not in self._read:
            self._read[relative] = read_bytes(self.path.parent / relative)
        return self._read[relative]

    def _check_texture(self, written: str) -> None:
        file = self.references[written]
        open_picture(BytesIO(self._contents(file)), self.path.parent / file)

    def _uri_bytes(self, uri: str) -> bytes:
        if not uri.startswith("data:"):
            return self._contents(self.references[uri])
        kind, comma, text = uri.partition(",")
        if not comma or not kind.endswith(";base64"):
            raise ValueError("a data URI that is not base64")
        if uri not in self._decoded:
            try:
                self._decoded[uri] = base64.b64decode(text)
            except binascii.Error as error:
                raise ValueError(f"a data URI: {error}") from None
        return self._decoded[uri]
