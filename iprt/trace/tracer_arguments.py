"""Arguments of the kernels that trace listed pixels."""

from __future__ import annotations

from dataclasses import dataclass

from iprt.device.block import Block, Float32, Floats, Int32, Ints, when


@dataclass(kw_only=True)
class PixelsArgs(Block):
    """Listed pixels of a layer to trace (`cl/lib/trace/traced.h`).

    Attributes
    ----------
    width, height : int
    rays : int
        Rays per pixel.
    frame_seed : int
    list : (width * height,) int32
        y * width + x.
    count : (1,) int32
        Length of the list.
    guide : 7 planes
    color : 3 planes or None
        Radiance of the layer, by which real surfaces are in the sun.
    pixel_angle : float
        Spread of the ray cones of pixels, radians: `View.pixel_angle`.
    """

    width: Int32
    height: Int32
    rays: Int32
    frame_seed: Int32
    list: Ints
    count: Ints
    guide: Floats
    color: Floats = when("SUN")
    pixel_angle: Float32 = when("TEXTURES")


@dataclass(kw_only=True)
class SurfacesArgs(Block):
    """Visible virtual surfaces of the traced pixels.

    Attributes
    ----------
    albedo : 3 planes
    metallic, roughness : 1 plane or None
        Metalness and alpha of GGX, where a material is principled.
    coat_normal : 2 planes or None
        Normals of clear coats (`cl/lib/world/finish.h`), where some have their own.
    variant : 1 plane or None
        1 + index of the material, where materials have variants.
    """

    albedo: Floats
    metallic: Floats = when("PRINCIPLED")
    roughness: Floats = when("PRINCIPLED")
    coat_normal: Floats = when("COAT_NORMALS")
    variant: Floats = when("VARIANTS")


@dataclass(kw_only=True)
class JitterArgs(Block):
    """Random positions in their pixel at which rays start.

    Attributes
    ----------
    metals, others : int
        1: rays of such surfaces start there; 0: at the pixel's centre.
    view : (16,) float32
        `View.kernel_constants()`.
    """

    metals: Int32 = when("OBJECTS_BVH")
    others: Int32 = when("OBJECTS_BVH")
    view: Floats = when("OBJECTS_BVH")


@dataclass(kw_only=True)
class KnownArgs(Block):
    """Temporal means of objects' reflected light in the last picture (`cl/lib/filter/signal.h`).

    Attributes
    ----------
    certainty : 2 planes
        Of any of the signals: all have the same rays, hence the same length.
    specular, diffuse : 5 planes or None
        History of the signal; None without it.
    mean_radiance : float
        Mean of the panorama.
    fading : float
        As in `FrameContext`; 0 also for the published method, whose rays do not follow noise.
    """

    certainty: Floats
    specular: Floats
    diffuse: Floats
    mean_radiance: Float32
    fading: Float32
