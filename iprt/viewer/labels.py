"""Texts of both viewers: names and tooltips."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from iprt.geometry.material import MaterialKind
from iprt.geometry.smooth_motion import Interpolation
from iprt.output.display import Curve
from iprt.settings.methods import methods
from iprt.viewer.state import PlaybackMode


@dataclass(frozen=True)
class Label:
    """A user-visible name with its explanation.

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
"""Name in place of the view's after the user has turned away."""
PICTURE = Label("Picture", "The finished picture: the video with the objects in it.")

CURVES: Mapping[Curve, Label] = {
    "srgb": Label("Standard", "Highlights are clipped at white, as in written files."),
    "filmic": Label("Filmic", "Highlights are compressed rather than cut off."),
}

NOTHING = Label("Nothing", "Only the picture is shown.")


def comparisons() -> Mapping[str, Label]:
    """Return the labels of all values of `iprt.viewer.lens.Lens.against`."""
    return {
        "input": Label("Input", "The video without objects."),
        "truth": Label("Truth", "The path-traced reference picture of this view."),
        "snapshot": Label("Snapshot", "The picture as it was when the snapshot was taken."),
        **{name: Label(f"Method {name}", f"{info.title}.") for name, info in methods().items()},
    }


MATERIALS: Mapping[MaterialKind, Label] = {
    "diffuse": Label("Matte", "Scatters light evenly, like plaster or paper."),
    "conductor": Label("Metal", "Reflects only, tinted by its color. Roughness 0 is a mirror."),
    "plastic": Label(
        "Plastic", "A clear coat over a matte base, like plastic, paint or glazed pottery."
    ),
    "principled": Label("Plastic and metal", "A mixture of both, as in glTF files."),
    "dielectric": Label("Glass", "Lets light through, and bends it, like glass, water or a pane."),
}

PLAYBACK: Mapping[PlaybackMode, Label] = {
    "real time": Label(
        "Real time", "Plays at the video's speed. Frames are skipped where the device is too slow."
    ),
    "every frame": Label(
        "Every frame", "Shows each frame before the next, at full quality, slower if need be."
    ),
}

INTERPOLATIONS: Mapping[Interpolation, Label] = {
    "linear": Label("Linear", "Straight and evenly to the next key."),
    "smooth": Label("Smooth", "Without corners, and from and to rest at the ends."),
    "step": Label("Step", "Stays until the next key."),
}

BY_HAND = "by hand"
"""Name in place of a word of scene.toml for a sun with numbers of its own."""
SUNS: Mapping[str, Label] = {
    "auto": Label("As found", "The sun whose patches of light are found in the first frame."),
    "none": Label("None", "No sun besides the light that the panorama shows."),
    BY_HAND: Label("Set by hand", "The sun of the numbers below, or of the arrow."),
}

LIGHTS: Mapping[str, Label] = {
    "point": Label(
        "Point or sphere", "It shines in all directions, or as its photometric file says."
    ),
    "spot": Label("Spot", "It shines in a cone."),
    "rectangle": Label("Rectangle", "It shines to one side."),
    "sun": Label("Sun", "It shines from far away, in through windows."),
}
UNITS: Mapping[str, Label] = {
    "relative": Label("relative", "Intensity in units of the picture's radiance."),
    "candela": Label("candela", "Luminous intensity in its main direction."),
    "lumen": Label("lumen", "Luminous flux in all directions together."),
    "watt": Label("watt", "Radiant flux of white light, 179 lumen each."),
    "lux": Label("lux", "Illuminance of a surface that faces the sun."),
}
PARTS: Mapping[str, Label] = {
    "view": Label("View", "The views of scene.toml, each with the objects that it shows."),
    "yaw": Label("Yaw", "To the right. Drag the picture to look around."),
    "pitch": Label("Pitch", "Up."),
    "fov": Label("Field of view", "Vertical. The mouse's wheel changes it."),
    "selected": Label("Selected", "Or click one in the picture. Shift+click puts it there."),
    "objects": Label("Objects", "Click one to select it, here or in the picture."),
    "preset": Label("Preset", "Sets the settings with the most effect on cost; all others stay."),
    "search": Label("Search settings", "Words of names, keys and tooltips."),
    "presets": Label(
        "Compare presets", "The settings in which presets differ, with the present values."
    ),
    "fps": Label(
        "Frame rate",
        "Frames per second to hold in this window while something moves, at a lower resolution if "
        "need be. 0: always at full quality.",
    ),
    "exposure": Label("Exposure", "Stops brighter or darker than the scene's own exposure."),
    "curve": Label("Tone curve", "Mapping of radiance to screen colors."),
    "buffer": Label("Show", "The picture, or one of the buffers that it is made from."),
    "low": Label("From", "Value with the first color."),
    "high": Label("To", "Value with the last color."),
    "auto range": Label("Own range", "The colors follow the range of the picture's values again."),
    "snapshot": Label("Snapshot", "Keeps the picture to compare others with."),
    "flip": Label("Flip", "Shows the snapshot in place of the picture, and back."),
    "back to snapshot": Label("Back to snapshot", "Restores its settings and edits."),
    "brighter": Label("Brighter", "Half a stop more exposure."),
    "darker": Label("Darker", "Half a stop less exposure."),
    "reset exposure": Label("Scene's exposure", "Sets the exposure back to the scene's own."),
    "flip curve": Label("Tone curve", "Switches between the tone curves."),
    "pin": Label("Pin pixel", "Keeps the values of the last clicked pixel on display."),
    "unpin": Label("Remove pins", "Removes all pinned pixels."),
    "against": Label("Compare with", "A second picture of the same view."),
    "split": Label("Divide at", "The picture is on the left, the compared one on the right."),
    "error": Label("Error map", "The difference of both pictures."),
    "material": Label("Material", "Applies to the whole object."),
    "albedo": Label("Color", "Diffuse albedo in red, green and blue."),
    "reflectance": Label("Color", "Specular reflectance in red, green and blue."),
    "alpha": Label("Roughness", "0 is polished, 1 is dull (GGX alpha)."),
    "metallic": Label("Metalness", "0 is plastic, 1 is metal."),
    "emission": Label(
        "Emission", "Radiance that it emits in its color, where 1 is the white of the video."
    ),
    "ior": Label(
        "Index of refraction",
        "How strongly a coat reflects, and glass bends light. Plastic and glass have about 1.5, "
        "water 1.33.",
    ),
    "transmittance": Label("Color", "Share of light that each surface of the glass lets through."),
    "transmission": Label("Transmission", "Share of light that passes, as through glass."),
    "clearcoat": Label("Clearcoat", "Strength of a clear coat above it, like varnish."),
    "clearcoat_alpha": Label("Clearcoat roughness", "0 is polished, 1 is dull (GGX alpha)."),
    "sheen": Label("Sheen", "Color of its edges, as fibres of velvet or dust give them."),
    "sheen_alpha": Label("Sheen roughness", "Small values keep to the edges, 1 is all over."),
    "tint": Label("Tint", "Of the reflection of its plastic, where one looks straight at it."),
    "thin": Label("Thin", "A pane or a bubble, without inside: light goes straight on."),
    "absorption": Label("Absorption", "Of red, green and blue inside of the glass, per metre."),
    "priority": Label(
        "Priority", "Where glass and liquid overlap, the higher one fills the space."
    ),
    "add light": Label(
        "Add a light", "Above the surface in the middle of the picture. It is not seen itself."
    ),
    "light": Label("Light", "The light is not seen itself. Move and turn it like an object."),
    "power": Label("Power", "Brightness of white light, in the unit below."),
    "unit": Label(
        "Unit",
        "The scene's `nits` tell how many candela per square metre a radiance of 1 is.",
    ),
    "light color": Label("Color", "Red, green and blue, which multiply the power."),
    "radius": Label("Radius", "Metres. A larger light casts softer shadows."),
    "inner": Label("Inner angle", "Half angle in degrees within which a spot is brightest."),
    "outer": Label("Outer angle", "Half angle in degrees beyond which a spot is dark."),
    "width": Label("Width", "Metres."),
    "height": Label("Height", "Metres."),
    "diameter": Label("Diameter", "Degrees that the sun appears to be wide."),
    "opacity": Label("Opacity", "Share of the rays that meet the surface."),
    "cutoff": Label(
        "Cutoff", "Opacity of the map from which all rays meet the surface; 0: their share does."
    ),
    "texture": Label("Color map", "Picture that the color multiplies."),
    "surface_texture": Label(
        "Roughness map", "Roughness in green and metalness in blue, as in glTF files."
    ),
    "normal_texture": Label("Normal map", "Bumps: directions of the surface, y up as in glTF."),
    "clearcoat_normal_texture": Label(
        "Clearcoat normal map", "Bumps of the clear coat. Without it the coat is even."
    ),
    "opacity_texture": Label("Opacity map", "In the picture's alpha channel, or in grey."),
    "emission_texture": Label("Emission map", "Picture that the emission multiplies."),
    "bare": Label("Remove maps", "The material becomes even and without holes."),
    "name": Label("Name", "As in scene.toml. A name that is taken gets a number."),
    "whole_groups": Label("Whole groups", "Selects all objects of a group with any of them."),
    "stepped": Label("Steps", "Gizmos move, turn and scale in steps. Ctrl does the other."),
    "step_m": Label("Step", "Of motion. Sizes change in steps of a tenth."),
    "step_deg": Label("Turn", "Step of rotation."),
    "array_count": Label("Count", "Number of objects in the row, with the selected one."),
    "array_step": Label("Distance", "From one to the next: x, y (up) and z."),
    "array": Label("Repeat", "Copies the selected objects along a line."),
    "duplicate": Label("Duplicate", "Copies the selected objects to their right."),
    "copy": Label("Copy", "For pasting here, or in another scene's viewer."),
    "paste": Label("Paste", "Adds the copied objects."),
    "settle": Label(
        "Drop to surface", "Onto the surface below, upright or along its normal as chosen."
    ),
    "group": Label("Group", "The selected objects are selected and moved as one."),
    "ungroup": Label("Ungroup", "Dissolves the groups of the selected objects."),
    "lock": Label("Lock", "Protects the selected objects against changes, or frees them."),
    "select all": Label("Select all", "All objects that are not locked."),
    "hide": Label("Hide", "Hides the selected objects in this window."),
    "show all": Label("Show all", "Shows all hidden objects."),
    "key": Label(
        "Set key",
        "Keeps where the selected objects are in this frame; without any, where the view looks.",
    ),
    "keys": Label("Key", "By frame. Of the selected object; of the view if nothing is selected."),
    "key_frame": Label("At frame", "Moves the chosen key."),
    "interpolation": Label("Then", "How the motion goes on to the next key."),
    "delete keys": Label("Delete keys", "Deletes the chosen keys."),
    "recording": Label("Record", "Moving an object sets a key. Otherwise its whole motion moves."),
    "view_name": Label(
        "Name", "Of the view, as in scene.toml. A name that is taken gets a number."
    ),
    "add view": Label("Add view", "A view that looks as this window does."),
    "look": Label("Look as now", "The view without keyframes gets the direction of this window."),
    "remove view": Label("Remove view", "Removes the view. Undo brings it back."),
    "position": Label("Position", "Centre of the bottom: x to the right, y up, z backwards."),
    "rotation": Label("Rotation", "About x, y (up) and z; y turns first."),
    "size": Label("Size", "Length of the longest side."),
    "snap": Label("Stay on surfaces", "The object slides over the surfaces of the video."),
    "align": Label(
        "Align to surface", "The object tilts with the surface. Otherwise it is upright."
    ),
    "gloss": Label(
        "Find reflections",
        "Glossy real surfaces are looked for in the video. Otherwise only surfaces that "
        "scene.toml declares reflect objects.",
    ),
    "sky": Label(
        "Estimate the sky",
        "The sky that windows do not show is estimated from the shading of the room. Otherwise it "
        "is extrapolated.",
    ),
    "sun": Label("Sun", "The sun that lights objects and casts their shadows."),
    "arrow": Label(
        "Show arrow", "It points along the sun's light. Drag the rings about it to turn the sun."
    ),
    "sun_yaw": Label("Yaw", "Direction of the sun, to the right; 0 is -Z, and 90 is +X."),
    "sun_pitch": Label("Pitch", "Height of the sun above the horizon."),
    "irradiance": Label(
        "Irradiance",
        "Of a surface that faces the sun, in the panorama's unit of radiance times sr; of the "
        "strongest of red, green and blue.",
    ),
    "sun_color": Label("Color", ""),
    "angle_deg": Label("Diameter", "Apparent diameter of the sun. A large one has soft shadows."),
    "add": Label(
        "Add mesh", "A .glb, .gltf, .obj, .ply, .stl or .usd file; it is set on a surface."
    ),
    "remove": Label("Remove", "Removes the selected object. Undo brings it back."),
    "undo": Label("Undo", "Undoes the last edit of an object or of the light."),
    "redo": Label("Redo", "Redoes the last undone edit."),
    "save": Label("Save", "Writes the edits to scene.toml. Comments stay."),
    "offer": Label("Unsaved edits", "The viewer that had them ended without saving."),
    "restore": Label("Restore", "Makes them unsaved edits again. Undo takes them back at once."),
    "discard": Label("Discard", "Deletes them."),
    "later": Label("Later", "Offers them again at the next start."),
    "play": Label("Play", "Plays the video, or pauses it."),
    "frame": Label("Frame", "Frame number, as in scene.toml."),
    "loop": Label("Loop", "Starts again at the end."),
    "screenshot": Label(
        "Screenshot",
        "PNG: the displayed picture. EXR: linear radiance, and the displayed buffer.",
    ),
}
"""Labels of widgets in both viewers, by the value that they change."""
