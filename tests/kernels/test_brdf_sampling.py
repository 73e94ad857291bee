"""Chi-square tests: brdf_sample() draws directions with the density that brdf_pdf() states."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from iprt.geometry.material import Material
from tests.kernels.brdf import call
from tests.oracles import brdf as oracle

SAMPLES = 1 << 17
BINS = 20
NODES = 20  # quadrature nodes per bin and axis
COATED = Material("principled", (0.4, 0.3, 0.2), 0.5, clearcoat=0.9)
MIRRORED = 2
CASES = (
    [
        (Material(kind, (0.4, 0.3, 0.2), alpha, 1.5), angle)
        for kind in ("conductor", "plastic")
        for alpha in (0.05, 0.125, 0.5, 1.0)
        for angle in (0, 30, 60, 85)
    ]
    + [
        (Material("principled", (0.4, 0.3, 0.2), alpha, 1.5, metallic=metallic), angle)
        for alpha in (0.125, 0.5)
        for metallic in (0.0, 0.3, 1.0)
        for angle in (30, 85)
    ]
    + [
        (replace(COATED, clearcoat_alpha=alpha, metallic=metallic, **more), angle)
        for alpha in (0.0, 0.125)
        for metallic in (0.3, 1.0)
        for more in ({}, {"sheen": (0.9, 0.3, 0.1)})
        for angle in (30, 85)
    ]
    + [(Material("diffuse"), 60), (Material("plastic", (0.4, 0.3, 0.2), 0.0, 1.5), 60)]
)
TILTED = [
    (replace(COATED, alpha=0.2, clearcoat_alpha=alpha, metallic=metallic), angle)
    for alpha in (0.125, 0.5)
    for metallic in (0.3, 1.0)
    for angle in (30, 60)
]
TILT = oracle.direction(35, 60)
"""Normal of their clearcoats."""
SIGNIFICANCE = 1 - (1 - 0.01) ** (1 / len(CASES + TILTED))
"""Šidák: all cases together reject a right sampler once in 100 sets of samples."""


def angles(directions, o):
    """(N, 2): polar angle; azimuth from the mirror direction of o, in (-pi, pi]."""
    theta = np.arccos(np.clip(directions[:, 2], -1, 1))
    phi = np.arctan2(directions[:, 1], directions[:, 0]) - np.arctan2(-o[1], -o[0])
    return np.stack([theta, (phi + np.pi) % (2 * np.pi) - np.pi], -1)


def equal_bins(values, low, high):
    inner = np.quantile(values, np.linspace(0, 1, BINS + 1)[1:-1])
    return np.concatenate([[low], inner, [high]])


def expected_share(density, o, theta_edges, phi_edges):
    """(BINS, BINS): the density's integral over each bin, delta lobes left out."""
    x, weight = np.polynomial.legendre.leggauss(NODES)

    def nodes(edges):
        middle, width = (edges[1:] + edges[:-1]) / 2, np.diff(edges) / 2
        return (middle[:, None] + width[:, None] * x).ravel(), (width[:, None] * weight).ravel()

    theta, theta_weight = nodes(theta_edges)
    phi, phi_weight = nodes(phi_edges)
    azimuth = phi + np.arctan2(-o[1], -o[0])
    i = np.stack(
        np.broadcast_arrays(
            np.sin(theta)[:, None] * np.cos(azimuth),
            np.sin(theta)[:, None] * np.sin(azimuth),
            np.cos(theta)[:, None],
        ),
        axis=-1,
    )
    mass = density(i) * np.sin(theta)[:, None] * theta_weight[:, None] * phi_weight
    return mass.reshape(BINS, NODES, BINS, NODES).sum((1, 3))


@pytest.mark.parametrize(("material", "angle"), CASES)
def test_samples_follow_their_density(device, material, angle):
    rng = np.random.default_rng([int(material.alpha * 1000), angle])
    o = oracle.direction(angle, 25)
    drawn = call(device, "sample", material, o, rng.random((SAMPLES, 3), np.float32))
    i = drawn["wi"].astype(float)
    # The mirror direction has no density.
    if material.is_covered:
        i = i[drawn["specular"] != MIRRORED]
    elif material.alpha == 0:
        i = i[drawn["specular"] == 0]
    above = angles(i[i[:, 2] > 0], o)
    confirm(above, o, np.pi / 2, lambda i: oracle.density(material, o, i).sum(-1))


@pytest.mark.parametrize(("material", "angle"), TILTED)
def test_samples_of_clearcoats_with_normals_of_their_own(device, material, angle):
    """Their densities count below the plane of the shading normal too."""
    rng = np.random.default_rng([int(material.clearcoat_alpha * 1000), angle])
    o = oracle.direction(angle, 25)
    drawn = call(device, "sample", material, o, rng.random((SAMPLES, 3), np.float32), coat=TILT)
    everywhere = angles(drawn["wi"].astype(float), o)
    confirm(everywhere, o, np.pi, lambda i: oracle.density(material, o, i, TILT).sum(-1))


def confirm(drawn, o, most, density):
    """Compare the angles of drawn directions, up to a polar angle, with their density."""
    # Bins from one half of the samples, counts from the other: the edges are no fit to the counts.
    pilot, counted = drawn[::2], drawn[1::2]
    theta_edges = equal_bins(pilot[:, 0], 0, most)
    phi_edges = equal_bins(pilot[:, 1], -np.pi, np.pi)
    share = expected_share(density, o, theta_edges, phi_edges).ravel()
    counts = np.histogram2d(*counted.T, bins=(theta_edges, phi_edges))[0].ravel()
    # Half of all draws, wherever they went; what fell below the surface is one bin more.
    total = SAMPLES // 2
    expected = np.append(share, 1 - share.sum()) * total
    counts = np.append(counts, total - counts.sum())
    order = np.argsort(expected)
    pooled = np.cumsum(expected[order]) <= 20
    counts = np.append(counts[order][~pooled], counts[order][pooled].sum())
    expected = np.append(expected[order][~pooled], expected[order][pooled].sum())
    kept = expected > 5
    statistic = np.sum((counts - expected)[kept] ** 2 / expected[kept])
    assert chi2.sf(statistic, np.count_nonzero(kept) - 1) > SIGNIFICANCE
