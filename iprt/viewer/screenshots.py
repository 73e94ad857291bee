"""Folder, names and metadata of screenshots and renders."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path

from platformdirs import user_pictures_path

from iprt.files.atomic import require_writable
from iprt.output.metadata import picture_metadata
from iprt.output.picture import check_output, write_picture, write_pixels
from iprt.viewer.displayed_frame import DisplayedFrame
from iprt.viewer.engine import Engine
from iprt.viewer.session import Shown

FOLDER = "iprt"


def default_folder() -> Path:
    """Return the folder `iprt` in the user's pictures folder; it may not exist."""
    return user_pictures_path() / FOLDER


def free_path(
    scene: str,
    view: str | None,
    suffix: str,
    folder: Path | None = None,
    taken: Callable[[Path], bool] = Path.exists,
) -> Path:
    """Return an unused absolute path such as `room-table-0001.png`.

    Parameters
    ----------
    scene : str
    view : str or None
        Name of the scene's view; None for the user's own.
    suffix : str
        End of the name, such as `.png`.
    folder : Path or None
        None for `default_folder()`.
    taken : callable
        Returns True for a path that is in use.
    """
    folder = (default_folder() if folder is None else folder).resolve()
    stem = re.sub(r"[^\w. -]", "_", f"{scene}-{view or 'view'}")
    number = 1
    while taken(path := folder / f"{stem}-{number:04d}{suffix}"):
        number += 1
    return path


def metadata_of(engine: Engine, shown: Shown) -> dict[str, str]:
    """Return the metadata of a picture that the engine rendered with its own settings."""
    settings = engine.world.settings
    return picture_metadata(
        scene=engine.scene.name,
        view=shown.request.view,
        objects=shown.request.objects,
        settings=settings.model_dump(mode="json"),
        seed=settings.seed,
        frames=shown.frames,
        device=shown.device,
    )


def write_screenshot(path: Path, displayed: DisplayedFrame, metadata: Mapping[str, str]) -> None:
    """Write displayed pixels to PNG, or the linear picture and its buffers to EXR.

    Raises
    ------
    IprtError
        The file cannot be written.
    """
    check_output(path)
    require_writable(path)
    if path.suffix.lower() == ".png":
        write_pixels(path, displayed.pixels, metadata=metadata)
    else:
        picture = displayed.shown.picture
        write_picture(path, picture.color, aovs=picture.aovs, metadata=metadata)
