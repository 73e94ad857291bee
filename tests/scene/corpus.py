"""Write the corpus of nasty files, and read files of any kind as the program does.

`python -m tests.scene.corpus FOLDER` writes all of them, reads each with little memory to spare,
and prints what came of it as JSON: name -> [kind of error, its text].
"""

from __future__ import annotations

import json
import resource
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np

from iprt.errors import FormatError, IprtError
from iprt.files.images import read_color, read_depth, read_header
from iprt.footage.depth_summary import DepthSummary
from iprt.footage.prepare.metres import StoredDepth
from iprt.footage.video.color import linear_color
from iprt.footage.video.container import video_streams
from iprt.footage.video.depth_code import DepthCode, DepthSamples
from iprt.footage.video.reader import open_streams
from iprt.geometry.ies import read_ies
from iprt.geometry.mesh import Mesh
from iprt.geometry.meshes import load_mesh
from iprt.scene.scene import Scene
from iprt.settings.overrides import read_settings, resolved
from tests.scene import nasty_meshes, nasty_text, nasty_video  # noqa: F401  (they add to the corpus)
from tests.scene.files import CUBE, write_scene
from tests.scene.nasty import CORPUS, Nasty, Reader

SPARE = 2**29
"""Bytes of address space that reading one of the files may take."""
SECONDS = 5
"""The processor's time that it may take: the slowest takes a tenth."""
PATIENCE = 60
"""Seconds until it is taken to wait for something."""


def read_mesh(path: Path) -> Mesh:
    """A mesh, of which all that the renderer relies on holds."""
    mesh = load_mesh(path)
    assert np.isfinite(mesh.positions).all()
    assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-3)
    assert np.isfinite(mesh.uvs).all()
    assert mesh.triangles.min() >= 0
    assert mesh.triangles.max() < len(mesh.positions) == len(mesh.normals) == len(mesh.uvs)
    assert 0 <= mesh.material_index.min() <= mesh.material_index.max() < len(mesh.materials)
    assert len(mesh.material_index) == len(mesh.triangles)
    for material in mesh.materials:
        numbers = (material.alpha, material.ior, material.clearcoat, material.sheen_alpha)
        colors = (material.albedo, material.emission, material.absorption, material.sheen)
        assert np.isfinite([*numbers, *np.ravel(colors)]).all()
    return mesh


def read_lights(path: Path) -> None:
    photometry = read_ies(path)
    assert np.isfinite(photometry.candela)
    assert np.isfinite(photometry.profile).all()
    assert photometry.profile.min() >= 0.0


def read_color_plane(path: Path) -> None:
    color = read_color(path)
    assert color.dtype == np.float32
    assert color.ndim == 3
    assert color.shape[2] == 3


def read_depth_plane(path: Path) -> None:
    depth, bits = read_depth(path)
    assert depth.dtype == np.float32
    assert depth.ndim == 2
    samples = DepthSamples(depth, 0.0, 2.0**bits - 1.0 if bits else 1.0, bits, exact=True)
    for code in (DepthCode(0.001), DepthCode(None, (9.0, 0.5), "inverse", "cube")):
        with suppress(FormatError):  # floats beyond the range
            stored = StoredDepth.of(path, samples, code)
            assert stored.metres(path, samples, code).shape == depth.shape
    if depth.shape[1] == 2 * depth.shape[0]:
        DepthSummary.of(depth)


def read_scene(path: Path) -> None:
    scene = Scene.open(path.parent)
    frame = scene.frame()
    assert np.isfinite(frame.color).all()
    assert (frame.depth > 0.0).all()
    assert np.isfinite(frame.fitted_normal).all()
    for instance in scene.instances:
        assert np.isfinite(instance.to_world).all()
        assert len(instance.mesh.triangles)


def read_video(path: Path) -> None:
    """Some rows of the first frame of every stream."""
    infos = video_streams(path)
    with open_streams() as streams:
        for info in infos:
            frame = streams(info).at(info.start)
            linear_color(frame, slice(0, min(frame.height, 16)), path)
            assert info.last >= info.start
            assert info.rate > 0


READERS: dict[Reader, Callable[[Path], object]] = {
    "color": read_color_plane,
    "depth": read_depth_plane,
    "header": read_header,
    "ies": read_lights,
    "mesh": read_mesh,
    "manifest": lambda path: Scene.open(path.parent),
    "scene": read_scene,
    "video": read_video,
    "settings": lambda path: resolved("balanced", read_settings(path)),
}


def write_corpus(folder: Path) -> dict[str, tuple[Nasty, Path]]:
    """Each file in a folder of its own, by name."""
    files = {}
    for number, entry in enumerate(CORPUS):
        own = folder / f"{number:03}"
        own.mkdir(parents=True)
        entry.write(own / entry.file)
        files[entry.name] = (entry, own / entry.file)
    assert len(files) == len(CORPUS), "names must differ"
    return files


def main() -> None:
    files = write_corpus(Path(sys.argv[1]))
    # Once without a limit, so that libraries are loaded.
    scene = write_scene(Path(sys.argv[1]) / "scene")
    Scene.open(scene).frame()
    (scene / "cube.obj").write_text(CUBE)
    load_mesh(scene / "cube.obj")
    read_video(nasty_video.beside(scene / "v.ts"))
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + SPARE
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    for number in (signal.SIGALRM, signal.SIGPROF):
        signal.signal(number, _too_slow)
    outcome = {}
    for name, (entry, path) in files.items():
        kind, text = "", ""
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        signal.alarm(PATIENCE)
        try:
            READERS[entry.reader](path)
        except Exception as error:
            kind = "IprtError" if isinstance(error, IprtError) else type(error).__name__
            text = str(error).replace(str(path.parent) + "/", "")
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.alarm(0)
        outcome[name] = kind, text
    print(json.dumps(outcome))


def _too_slow(*_: object) -> None:
    raise TimeoutError


if __name__ == "__main__":
    main()
