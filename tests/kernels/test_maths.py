"""cl/lib/maths/maths.h against float64."""

import numpy as np

from tests.kernels.wrap import evaluate


def exp2(device, x):
    return evaluate(device, ["maths/maths.h"], "y = fast_exp2(x);", {"x": x}, {"y": "float"})["y"]


def test_exp2_keeps_its_stated_error(device):
    x = np.linspace(-126, 126.99, 200_001).astype(np.float32)
    relative = exp2(device, x) / np.exp2(x.astype(np.float64)) - 1
    assert np.abs(relative).max() < 1.1e-4
    near_zero = np.float32(np.concatenate([-np.geomspace(1e-9, 1, 999), [0, -0.0]]))
    assert np.abs(exp2(device, near_zero) / np.exp2(np.float64(near_zero)) - 1).max() < 1.1e-4


def test_exp2_is_exact_at_integers_and_monotone(device):
    powers = np.arange(-126, 128, dtype=np.float32)
    np.testing.assert_array_equal(exp2(device, powers), np.exp2(powers.astype(np.float64)))
    dense = np.linspace(-3, 3, 100_001, dtype=np.float32)
    assert np.all(np.diff(exp2(device, dense)) >= 0)


def test_exp2_of_anything_is_finite(device):
    x = np.float32([-np.inf, -1e30, -127, 128, 1e30, np.inf, np.nan])
    y = exp2(device, x)
    assert np.all(np.isfinite(y))
    assert y[0] <= 2.0**-126
    assert y[-2] >= 2.0**127


def test_the_unit_circle_keeps_its_stated_error(device):
    u = np.linspace(0, 1, 100_001, dtype=np.float32)
    p = evaluate(device, ["maths/maths.h"], "p = unit_circle(u);", {"u": u}, {"p": "float2"})["p"]
    turn = 2 * np.pi * u.astype(np.float64)
    assert np.abs(p - np.stack([np.cos(turn), np.sin(turn)], 1)).max() < 3e-7


def test_atan2_keeps_its_stated_error_in_every_octant(device):
    angle = np.linspace(-np.pi, np.pi, 100_001)
    length = np.geomspace(1e-12, 1e12, angle.size)
    y, x = np.float32([np.sin(angle) * length, np.cos(angle) * length])
    body, given = "a = fast_atan2(y, x);", {"y": y, "x": x}
    found = evaluate(device, ["maths/maths.h"], body, given, {"a": "float"})["a"]
    error = found - np.arctan2(y.astype(np.float64), x.astype(np.float64))
    assert np.abs(error).max() < 3e-7
    small = np.abs(angle) < 1e-3  # relative there, so that texels of any panorama stay apart
    np.testing.assert_allclose(found[small], np.arctan2(y[small], x[small]), rtol=2e-7)


def test_atan2_on_the_axes(device):
    y, x = np.float32([[0, 1, 0, -1, 0, -0.0, 1e-40], [1, 0, -1, 0, 0, -1, 0]])
    body, given = "a = fast_atan2(y, x);", {"y": y, "x": x}
    found = evaluate(device, ["maths/maths.h"], body, given, {"a": "float"})["a"]
    expected = np.pi * np.array([0, 0.5, 1, -0.5, 0, -1])
    np.testing.assert_allclose(found[:6], expected, atol=3e-7)
    assert np.isfinite(found[6])


def test_luminance_is_that_of_linear_rec709(device):
    rgb = np.float32([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]])
    y = evaluate(device, ["maths/maths.h"], "y = luminance(c);", {"c": rgb}, {"y": "float"})["y"]
    np.testing.assert_allclose(y, [0.2126, 0.7152, 0.0722, 1], rtol=1e-6)


def test_normalize_survives_any_length(device):
    direction = np.array([0.6, -0.64, 0.48])
    lengths = [1e-25, 1e-15, 1, 1e15, 1e30, 0, np.nan, np.inf]
    v = np.float32([direction * s for s in lengths])
    body = "n = safe_normalize(v, (float3)(0.0f, 1.0f, 0.0f));"
    n = evaluate(device, ["maths/maths.h"], body, {"v": v}, {"n": "float3"})["n"]
    np.testing.assert_allclose(n[:5], np.tile(direction, (5, 1)), atol=3e-7)
    np.testing.assert_array_equal(n[5:], np.tile([0, 1, 0], (3, 1)))


def test_finite_checks(device):
    x = np.float32([0, -1e38, 1e-40, np.inf, -np.inf, np.nan])
    body = "y = is_finite(x); z = is_finite3((float3)(0.0f, x, 1.0f));"
    out = evaluate(device, ["maths/maths.h"], body, {"x": x}, {"y": "int", "z": "int"})
    np.testing.assert_array_equal(out["y"] != 0, np.isfinite(x))
    np.testing.assert_array_equal(out["z"] != 0, np.isfinite(x))


def test_the_falloff_is_its_power_and_ends_at_eight(device):
    x = np.concatenate([np.linspace(0, 20, 2001), [8, np.inf, np.nan]]).astype(np.float32)
    y = evaluate(device, ["maths/maths.h"], "y = falloff(x);", {"x": x}, {"y": "float"})["y"]
    truth = np.nan_to_num(np.clip(1 - x.astype(np.float64) / 8, 0, 1) ** 8, nan=0.0)
    np.testing.assert_allclose(y, truth, rtol=1e-5, atol=1e-30)
    assert np.all(y[~(x < 8)] == 0)
    assert np.abs(y - np.exp(-x.astype(np.float64)))[:2001].max() < 0.04  # what it stands for
