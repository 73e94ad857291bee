"""What a picture says about its own making, so that it can be made again."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict

from iprt import __version__
from iprt.scene.camera import View


def picture_metadata(
    *,
    scene: str,
    view: View,
    objects: tuple[str, ...] | None,
    settings: Mapping[str, object],
    seed: int,
    frames: int,
    device: str,
) -> dict[str, str]:
    """Header attributes of a rendered picture; `iprt:view` and `iprt:settings` are JSON.

    Parameters
    ----------
    scene, device : str
        Names.
    objects : tuple of str or None
        Names of the inserted objects; None: all.
    settings : mapping
        Plain values, as `json` takes them.
    frames : int
        Frames accumulated.
    """
    return {
        "iprt:version": __version__,
        "iprt:scene": scene,
        "iprt:view": json.dumps({**asdict(view), "objects": objects}),
        "iprt:settings": json.dumps(dict(settings), sort_keys=True),
        "iprt:seed": str(seed),
        "iprt:frames": str(frames),
        "iprt:device": device,
    }
