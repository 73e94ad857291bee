"""Lights in `scene.toml`: units, faults, and `iprt scene light`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from iprt import cli
from iprt.errors import SceneError
from iprt.geometry.ies import Luminaire
from iprt.geometry.light import PROFILE_SHAPE, Light
from iprt.scene.light_tables import checked_light
from iprt.scene.manifest import parse_manifest
from iprt.scene.scene import Scene
from tests.scene.files import MANIFEST, VIEW, snapshot, write_scene

LIGHT = """
[[objects]]
name = "light"
light = { LIGHT }
to_world = [ 1, 0, 0, 0,   0, 1, 0, 0,   0, 0, 1, -1,   0, 0, 0, 1 ]
"""
NITS = 200.0


def light_of(**values: Any) -> Light:
    return checked_light(values).light(NITS)


@pytest.fixture
def room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr("iprt.scene.real_materials.MIN_HEIGHT", 129)  # gloss is not looked for
    return write_scene(tmp_path / "room", MANIFEST + VIEW, width=256)


# Units ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("values", "solid_angle"),
    [
        ({"kind": "point"}, 4.0 * np.pi),
        ({"kind": "point", "radius": 0.3}, 4.0 * np.pi),
        ({"kind": "spot", "cone_deg": [60.0, 60.0]}, np.pi),
        ({"kind": "rectangle", "size": [2.0, 3.0]}, np.pi),
    ],
)
def test_units_of_power(values: dict[str, Any], solid_angle: float) -> None:
    """Lumen are candela times solid angle; a radiance of 1 is `NITS` cd/m²."""
    for unit, candela in (
        ("candela", 50.0),
        ("lumen", 50.0 / solid_angle),
        ("watt", 50.0 * 179.0 / solid_angle),
        ("relative", 50.0 * NITS),
    ):
        light = light_of(**values, power=50.0, unit=unit, color=[1.0, 0.5, 0.0])
        wanted = candela / NITS * np.array([1.0, 0.5, 0.0])
        np.testing.assert_allclose(light.intensity, wanted, rtol=1e-3)


def test_lux_of_a_sun() -> None:
    np.testing.assert_allclose(light_of(kind="sun", power=1e5, unit="lux").intensity, 1e5 / NITS)
    np.testing.assert_allclose(light_of(kind="sun", power=3.0).intensity, 3.0)


def test_a_profile_has_a_power_of_its_own() -> None:
    table = np.ones(PROFILE_SHAPE, np.float32)
    own = checked_light({"kind": "point", "profile": "a.ies"}).light(NITS, Luminaire(table, 60.0))
    np.testing.assert_allclose(own.intensity, 60.0 / NITS)
    values = {"kind": "point", "profile": "a.ies", "power": 10.0, "unit": "lumen"}
    other = checked_light(values).light(NITS, Luminaire(table, 60.0))
    np.testing.assert_allclose(other.intensity, 10.0 / (4.0 * np.pi) / NITS, rtol=1e-3)


# Faults --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("light", "told"),
    [
        ('kind = "lamp"', "objects.light.light: expected kind = 'point', 'spot'"),
        ('kind = "point"', "objects.light.light: needs a power, or a profile"),
        ('kind = "spot", power = 1.0, cone_deg = [40.0, 20.0]', "cone_deg: .* larger than the"),
        ('kind = "spot", power = -1.0', "light.power: expected greater than or equal to 0"),
        (
            'kind = "rectangle", power = 1.0, sise = [1.0, 1.0]',
            "sise: unknown key; did you mean size",
        ),
        ('kind = "sun", power = 1.0, unit = "lumen"', "unit: expected 'relative' or 'lux'"),
        ('kind = "point", profile = "../a.ies"', "leaves the scene's folder"),
    ],
)
def test_faults_are_named(light: str, told: str) -> None:
    with pytest.raises(SceneError, match=told):
        parse_manifest(MANIFEST + LIGHT.replace("LIGHT", light), "scene.toml")


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ('mesh = "a.ply"', "needs either a mesh or a light"),
        ('material = { kind = "diffuse", albedo = [1.0, 1.0, 1.0] }', "has no material"),
        ("animation = 0", "has no animation"),
    ],
)
def test_a_light_is_nothing_else(more: str, told: str) -> None:
    text = LIGHT.replace("LIGHT", 'kind = "point", power = 1.0') + more
    with pytest.raises(SceneError, match=told):
        parse_manifest(MANIFEST + text, "scene.toml")


def test_few_lights_are_read() -> None:
    one = LIGHT.replace("LIGHT", 'kind = "point", power = 1.0')
    text = "".join(one.replace('"light"', f'"light {n}"') for n in range(129))
    with pytest.raises(SceneError, match="129 of them are lights without geometry; at most 128"):
        parse_manifest(MANIFEST + text, "scene.toml")


# iprt scene light ----------------------------------------------------------------------------


IES = "TILT=NONE\n1 0 1 2 1 1 2 0 0 0\n1 1 10\n0 90\n0\n70 0\n"


def test_lights_hang_above_the_surface_and_shine_down(
    room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = Scene.open(room)
    profile = tmp_path / "down.ies"
    profile.write_text(IES)
    flags = ["--look", "0", "-50", "--above", "0.7", "--turn", "30", "--json"]
    spot = [
        "spot",
        "--power",
        "800",
        "--unit",
        "lumen",
        "--cone",
        "10",
        "20",
        "--color",
        "1",
        "0.5",
        "0",
    ]
    assert cli.main(["scene", "light", str(room), *spot, *flags]) == 0
    told = json.loads(capsys.readouterr().out)
    assert cli.main(["scene", "light", str(room), "point", "--profile", str(profile), *flags]) == 0
    scene = Scene.open(room)
    added = {instance.name: instance for instance in scene.instances}
    light, hung = added["spot"].mesh.light, added["spot"].to_world
    assert light is not None
    assert light.cone_deg == (10.0, 20.0)
    assert light.intensity[0] == 2.0 * light.intensity[1] > 0.0 == light.intensity[2]
    np.testing.assert_allclose(hung[:3, 2], [0.0, 1.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(hung[:3, :3] @ hung[:3, :3].T, np.eye(3), atol=1e-6)
    assert np.linalg.det(hung[:3, :3]) == pytest.approx(1.0)
    np.testing.assert_allclose(told["position"], hung[:3, 3], atol=1e-5)
    # The point below it is seen in that direction.
    foot = hung[:3, 3] - [0.0, 0.7, 0.0]
    assert np.rad2deg(np.arctan2(foot[1], np.hypot(foot[0], foot[2]))) == pytest.approx(
        -50.0, abs=1.0
    )
    point = added["point"].mesh.light
    assert point is not None
    assert point.profile is not None
    assert point.intensity[0] == pytest.approx(0.7)  # 70 cd at 100 nits
    assert (room / "profiles" / "down.ies").read_text() == IES
    assert {*before.views} == {*scene.views}


def test_a_sun_shines_from_where_one_looks(room: Path) -> None:
    assert cli.main(["scene", "light", str(room), "sun", "--look", "90", "30", "--power", "2"]) == 0
    (sun,) = Scene.open(room).instances
    np.testing.assert_allclose(sun.to_world[:3, 2], [0.75**0.5, 0.5, 0.0], atol=1e-6)
    light = sun.mesh.light
    assert light is not None
    assert light.intensity == (2.0, 2.0, 2.0)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["spot"], "light.power: required key is missing"),
        (["rectangle", "--power", "1", "--radius", "2"], "light.radius: unknown key"),
        (["sun", "--power", "1", "--unit", "watt"], "light.unit: expected 'relative' or 'lux'"),
        (["point", "--profile", "no.ies"], "no.ies: no such file"),
        (["point", "--power", "1", "--above", "nan"], "point cannot be added"),
        (["point", "--power", "1", "--name", "a/b"], "--name 'a/b'"),
    ],
)
def test_mistakes_change_nothing(
    room: Path, words: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    before = snapshot(room)
    assert cli.main(["scene", "light", str(room), *words, "--look", "0", "-50"]) == 2
    assert told in capsys.readouterr().err
    assert snapshot(room) == before
