"""Small USD files, written as text or by USD."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.geometry.mesh import Mesh
from iprt.geometry.usd_data import UsdContents
from iprt.geometry.usd_file import UsdFile

SQUARE = """
    def Mesh "square"
    {
        uniform token subdivisionScheme = "none"
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (
            interpolation = "vertex"
        )
        MORE
    }
"""


def usda(path: Path, body: str, *, up: str = "Y", unit: float = 1.0) -> Path:
    """Write a layer with these prims below the prim `thing`."""
    head = f'#usda 1.0\n(\n    defaultPrim = "thing"\n    metersPerUnit = {unit}\n'
    head += f'    upAxis = "{up}"\n)\n'
    path.write_text(f'{head}def Xform "thing"\n{{\n{body}\n}}\n')
    return path


def square(more: str = "") -> str:
    """Return a mesh of 1 x 1, which faces +Z, with more properties."""
    return SQUARE.replace("MORE", more)


def surface(inputs: str, nodes: str = "", square_more: str = "") -> str:
    """Return a square with a UsdPreviewSurface of these inputs."""
    shader = "\n            ".join(inputs.splitlines())
    bound = f"rel material:binding = </thing/look>\n        {square_more}"
    apply = SQUARE.replace('"square"\n', '"square" (prepend apiSchemas = ["MaterialBindingAPI"])\n')
    return f"""{apply.replace("MORE", bound)}
    def Material "look"
    {{
        token outputs:surface.connect = </thing/look/s.outputs:surface>
        def Shader "s"
        {{
            uniform token info:id = "UsdPreviewSurface"
            {shader}
            token outputs:surface
        }}
        {nodes}
    }}
"""


def texture(name: str, file: str, more: str = "") -> str:
    """Return a node that reads a picture."""
    return f"""
        def Shader "{name}"
        {{
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @{file}@
            float2 inputs:st.connect = </thing/look/reader.outputs:result>
            float3 outputs:rgb
            float outputs:r
            float outputs:g
            float outputs:b
            float outputs:a
            {more}
        }}
"""


READER = """
        def Shader "reader"
        {
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "st"
            float2 outputs:result
        }
"""


def corners(mesh: Mesh) -> NDArray[np.float64]:
    """Return the corners (F, 3, 3) of triangles, in an order that their storage does not change."""
    points = mesh.positions[mesh.triangles].astype(np.float64).round(5) + 0.0
    first = np.array([np.lexsort(each.T[::-1])[0] for each in points])
    turned = np.stack([np.roll(each, -k, axis=0) for each, k in zip(points, first, strict=True)])
    return turned[np.lexsort(turned.reshape(len(turned), -1).T[::-1])]


@pytest.fixture
def in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Read USD without a process of its own, which takes a second to start."""
    from iprt.errors import FormatError
    from iprt.geometry.usd_child import read_stage

    def read(self: UsdFile, root: Path, within: Path, target: Path) -> object:
        contents: UsdContents = read_stage(root, within, self._path, target)
        if contents.error is not None:
            raise FormatError(contents.error)
        with np.load(target, allow_pickle=False) as stored:
            return contents, dict(stored)

    monkeypatch.setattr(UsdFile, "_read", read)
