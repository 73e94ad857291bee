"""Mitsuba sensor with exactly the projections of `iprt.geometry.camera.View`.

Mitsuba has no spherical sensor, and its perspective sensor has conventions of its own.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from iprt.geometry.camera import View
from iprt.truth.backend import mitsuba

PLUGIN = "iprt_view"


def sensor(view: View, *, pixel_centres: bool = False) -> Any:
    """Return a Mitsuba sensor at the world's origin, with a box pixel filter.

    Parameters
    ----------
    pixel_centres : bool
        Every sample goes through its pixel's centre instead of a random point of the pixel.
    """
    mi = mitsuba()
    _register()
    rotation = view.world_from_view
    return mi.load_dict(
        {
            "type": PLUGIN,
            "equirect": view.projection == "equirect",
            "pixel_centres": pixel_centres,
            "focal_px": view.focal_px,
            "to_world": mi.ScalarTransform4f(
                [[*rotation[0], 0.0], [*rotation[1], 0.0], [*rotation[2], 0.0], [0, 0, 0, 1.0]]
            ),
            "film": {
                "type": "hdrfilm",
                "width": view.width,
                "height": view.height,
                "pixel_format": "rgb",
                "component_format": "float32",
                "filter": {"type": "box"},
            },
            "sampler": {"type": "independent"},
        }
    )


@cache
def _register() -> None:
    import drjit as dr

    mi = mitsuba()

    class ViewSensor(mi.Sensor):  # type: ignore[misc, name-defined]
        def __init__(self, props: Any) -> None:
            super().__init__(props)
            self.equirect = props.get("equirect")
            self.pixel_centres = props.get("pixel_centres")
            self.focal_px = props.get("focal_px")
            self.size = self.film().size()
            self.rotation = self.world_transform()

        def sample_ray(
            self, time: Any, wavelength: Any, position: Any, aperture: Any, active: Any = True
        ) -> Any:
            ray, weight = self.sample_ray_differential(time, wavelength, position, aperture, active)
            return mi.Ray3f(ray), weight

        def sample_ray_differential(
            self, time: Any, wavelength: Any, position: Any, aperture: Any, active: Any = True
        ) -> Any:
            x, y = position.x * self.size.x, position.y * self.size.y
            if self.pixel_centres:
                x, y = dr.floor(x) + 0.5, dr.floor(y) + 0.5
            if self.equirect:
                phi = (x / self.size.x - 0.5) * 2.0 * dr.pi
                theta = y / self.size.y * dr.pi
                (sin_phi, cos_phi), (sin_theta, cos_theta) = dr.sincos(phi), dr.sincos(theta)
                local = mi.Vector3f(sin_theta * sin_phi, cos_theta, -sin_theta * cos_phi)
            else:
                local = mi.Vector3f(
                    x - 0.5 * self.size.x, 0.5 * self.size.y - y, -mi.Float(self.focal_px)
                )
            ray = mi.RayDifferential3f()
            ray.time = time
            ray.wavelengths = []
            ray.o = mi.Point3f(0.0)
            ray.d = self.rotation @ dr.normalize(local)
            return ray, mi.Color3f(1.0)

    mi.register_sensor(PLUGIN, ViewSensor)
