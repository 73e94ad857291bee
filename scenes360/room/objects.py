"""Meshes of the inserted objects."""

from __future__ import annotations

import numpy as np

from scenes360.modelling import Solid, join, lathe, sphere, torus_knot, tube


def objects() -> dict[str, Solid]:
    """Return the meshes of the inserted objects, standing on y = 0 around the origin."""
    vase = lathe(
        [
            (0, 0),
            (0.045, 0),
            (0.055, 0.006),
            (0.085, 0.07),
            (0.09, 0.12),
            (0.06, 0.20),
            (0.035, 0.25),
            (0.034, 0.28),
            (0.05, 0.31),
            (0.046, 0.312),
            (0.03, 0.28),
            (0.03, 0.25),
            (0.054, 0.20),
            (0.082, 0.12),
            (0.078, 0.07),
            (0.045, 0.015),
            (0, 0.012),
        ],
        smooth=5,
        segments=72,
    )
    body = lathe(
        [
            (0, 0),
            (0.06, 0),
            (0.068, 0.006),
            (0.10, 0.05),
            (0.108, 0.09),
            (0.085, 0.135),
            (0.05, 0.152),
            (0.046, 0.158),
            (0.03, 0.172),
            (0.012, 0.178),
            (0.010, 0.186),
            (0.019, 0.196),
            (0.016, 0.208),
            (0, 0.212),
        ],
        smooth=5,
        segments=72,
    )
    t = np.linspace(0, 1, 28)
    spout = tube(
        np.stack([0.085 + 0.10 * t, 0.06 + 0.03 * t + 0.06 * t**2, 0 * t], -1),
        0.026 - 0.013 * t,
        segments=20,
    )
    a = np.linspace(-0.62 * np.pi, 0.62 * np.pi, 36)
    handle = tube(
        np.stack([-0.10 - 0.058 * np.cos(a), 0.092 + 0.052 * np.sin(a), 0 * a], -1),
        0.009,
        segments=14,
    )
    knot = torus_knot(2, 3, 0.125, 0.034)
    knot = knot.turned("x", 90)
    return {
        "vase": vase,
        "pot": join([body, spout, handle]),
        "knot": knot.at(0, -float(knot.positions[:, 1].min()), 0),
        "ball": sphere(0.14, segments=72).at(0, 0.14, 0),
    }
