"""`cl/lib/world/brdf.h` called from Python, by default in the local frame (normal +z)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.geometry.material import Material, material_table
from iprt.geometry.material_needs import MaterialNeeds
from tests.kernels.wrap import evaluate

Array = NDArray[np.float32]
Z = np.float32([0, 0, 1])
OUTPUTS = {
    "sample": {"wi": "float3", "weight": "float3", "specular": "int"},
    "eval": {"diffuse": "float", "specular": "float3"},
    "pdf": {"density": "float2"},
}
LOADED = """
    Material material = load_material(materials, 0);
#ifdef COAT_NORMALS
    material.coat_normal = coat_normal;
#endif
"""
BODY = {
    "sample": "const BrdfSample s = brdf_sample(material, albedo, n, wo, u);"
    "wi = s.wi; weight = s.weight; specular = s.specular;",
    "eval": "const BrdfValue v = brdf_eval(material, albedo, n, wo, wi);"
    "diffuse = v.diffuse; specular = v.specular;",
    "pdf": "density = brdf_pdf(material, albedo, n, wo, wi);",
}


def call(
    device: ComputeDevice,
    function: str,
    material: Material,
    wo: NDArray[np.floating],
    last: NDArray[np.floating],
    normal: NDArray[np.floating] = Z,
    coat: NDArray[np.floating] | None = None,
) -> dict[str, NDArray]:
    """brdf_sample (`last` = u), brdf_eval or brdf_pdf (`last` = wi); (3,) arguments repeat.

    `coat` is the clearcoat's normal in the frame of `normal`, of kernels with such normals.
    """
    count = len(last)
    inputs = {
        "albedo": np.tile(np.float32(material.albedo), (count, 1)),
        "n": np.broadcast_to(np.float32(normal), (count, 3)),
        "wo": np.broadcast_to(np.float32(wo), (count, 3)),
        "u" if function == "sample" else "wi": np.float32(last),
    }
    defines = defines_of(material)
    if coat is not None:
        inputs["coat_normal"] = np.broadcast_to(np.float32(coat), (count, 3))
        defines += ("COAT_NORMALS",)
    return evaluate(
        device,
        ["world/brdf.h"],
        LOADED + BODY[function],
        inputs,
        OUTPUTS[function],
        {"materials": material_table([material])},
        defines,
    )


def defines_of(material: Material) -> tuple[str, ...]:
    """Return the defines that a material needs."""
    needed = MaterialNeeds.of([material]).defines()
    return tuple(name for name, given in needed.items() if given and name != "EMISSION")


def grid(side: int, choices: int = 1) -> Array:
    """(choices side², 3) midpoints of a regular grid over [0, 1)³."""
    x = (np.arange(side) + 0.5) / side
    z = (np.arange(choices) + 0.5) / choices
    return np.stack(np.meshgrid(x, x, z), -1).reshape(-1, 3).astype(np.float32)
