"""The words of both viewers: what things are called, and what their tooltips say."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from iprt.geometry.material import MaterialKind
from iprt.output.tone import Curve
from iprt.settings.methods import methods
from iprt.viewer.state import PlaybackMode


@dataclass(frozen=True)
class Label:
    """A name for users.

    Attributes
    ----------
    name : str
        A word or two, to show.
    about : str
        A sentence or two, for a tooltip.
    """

    name: str
    about: str


TURNED = "(turned)"
"""Stands for the view's name once the user has looked elsewhere."""
PICTURE = Label("Picture", "The finished picture: the video with the objects in it.")
BUFFERS: Mapping[str, Label] = {
    "background": Label("Background", "The video without objects."),
    "normal": Label("Normal", "Which way surfaces face: x, y, z of the world as red, green, blue."),
    "depth": Label("Depth", "Distance from the camera in metres. Near is bright."),
    "albedo": Label("Albedo", "Base colour of the objects, without light."),
    "coverage": Label("Coverage", "How much of each pixel objects cover."),
    "motion": Label(
        "Motion", "How far each point has moved since the last frame. Grey: not at all."
    ),
    "ratio": Label(
        "Light ratio", "What objects make of the light on real surfaces. Grey: no change."
    ),
    "irradiance_real": Label("Light without objects", "Light that reaches real surfaces."),
    "irradiance_mixed": Label(
        "Light with objects", "Light that reaches real surfaces past the objects and from them."
    ),
    "diffuse": Label("Diffuse light", "Light that objects scatter in all directions."),
    "specular": Label("Reflections", "What shiny objects reflect."),
    "highlight": Label("Real reflections", "What glossy real surfaces reflect in the video."),
    "gloss": Label(
        "Change of real reflections", "What objects change in the reflections on real surfaces."
    ),
    "tracing_level": Label(
        "Ray density",
        "Where real surfaces are traced: every pixel (red), every second (yellow), every fourth "
        "(blue), or none (black).",
    ),
    "hit_distance": Label("Reflection distance", "How far away what objects reflect is."),
    "history_length": Label("Frames averaged", "How many frames each pixel is the mean of."),
    "variance": Label("Noise", "How noisy each pixel is before the filter."),
    "learned": Label(
        "Learned light", "What the method oil has learned of the light that real surfaces send."
    ),
}
"""All of `iprt.viewer.lens.BUFFERS`."""

CURVES: Mapping[Curve, Label] = {
    "srgb": Label("Standard", "What is brighter than white is white, as files are written."),
    "filmic": Label("Filmic", "Highlights are compressed rather than cut off."),
}

NOTHING = Label("Nothing", "Only the picture is shown.")


def comparisons() -> Mapping[str, Label]:
    """Labels of all values of `iprt.viewer.lens.Lens.against`."""
    return {
        "input": Label("Input", "The video without objects."),
        "truth": Label("Truth", "The path-traced reference picture of this view."),
        **{name: Label(f"Method {name}", f"{info.title}.") for name, info in methods().items()},
    }


MATERIALS: Mapping[MaterialKind, Label] = {
    "diffuse": Label("Matte", "Scatters light evenly, like plaster or paper."),
    "conductor": Label("Metal", "Reflects only, tinted by its colour. Roughness 0 is a mirror."),
    "plastic": Label(
        "Plastic", "A clear coat over a matte base, like plastic, paint or glazed pottery."
    ),
}

PLAYBACK: Mapping[PlaybackMode, Label] = {
    "real time": Label(
        "Real time", "Plays at the video's speed. Frames are skipped where the device is too slow."
    ),
    "every frame": Label(
        "Every frame", "Shows each frame before the next, at full quality, slower if need be."
    ),
}

PARTS: Mapping[str, Label] = {
    "view": Label("View", "The views of scene.toml, each with the objects that it shows."),
    "selected": Label("Selected", "Or click one in the picture."),
    "objects": Label("Objects", "Click one to select it, here or in the picture."),
    "preset": Label(
        "Preset", "Sets what differs most in cost; all other settings stay as they are."
    ),
    "fps": Label(
        "Frame rate",
        "Frames per second to hold in this window while something moves, at a lower resolution if "
        "need be. 0: always at full quality.",
    ),
    "exposure": Label("Exposure", "Stops brighter or darker than the scene's own exposure."),
    "curve": Label("Tone curve", "How bright values become colours of the screen."),
    "buffer": Label("Show", "The picture, or one of the buffers that it is made from."),
    "against": Label("Compare with", "A second picture of the same view."),
    "split": Label("Divide at", "The picture is left of it, what it is compared with right."),
    "error": Label("Error map", "Where the two differ, and how much."),
    "material": Label("Material", "Applies to the whole object."),
    "albedo": Label("Colour", "Share of the light that is scattered, in red, green and blue."),
    "reflectance": Label("Colour", "Share of the light that is reflected, in red, green and blue."),
    "alpha": Label("Roughness", "0 is polished, 1 is dull (GGX alpha)."),
    "ior": Label("Index of refraction", "How strongly the coat reflects. Plastic has about 1.5."),
    "texture": Label(
        "Remove texture", "A texture of a mesh file can be saved only with the file's own material."
    ),
    "position": Label("Position", "Metres: x to the right, y up, z backwards."),
    "size": Label("Size", "Metres, along the longest side."),
    "snap": Label("Stay on surfaces", "The object slides over the surfaces of the video."),
    "align": Label(
        "Align to surface", "The object tilts with the surface. Otherwise it is upright."
    ),
    "add": Label("Add mesh", "A .glb, .gltf, .obj, .ply or .stl file, set down on a surface."),
    "remove": Label("Remove", "Takes the selected object away. Undo brings it back."),
    "undo": Label("Undo", "Takes the last change to an object back."),
    "redo": Label("Redo", "Makes the change again that was undone last."),
    "save": Label("Save", "Writes the objects to scene.toml. Comments stay."),
    "play": Label("Play", "Plays the video, or pauses it."),
    "frame": Label("Frame", "As scene.toml counts."),
    "loop": Label("Loop", "Starts again at the end."),
    "screenshot": Label(
        "Screenshot",
        "PNG: the picture as it is seen. EXR: linear radiance, and the buffer that is shown.",
    ),
}
"""Labels of widgets that both viewers have, by what they change."""
