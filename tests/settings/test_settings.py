"""Settings: whatever the model holds can be set by file and flag, and what it forbids is named."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, get_args

import pytest
from pydantic import BaseModel, ConfigDict, Field

from iprt import cli
from iprt.errors import IprtError
from iprt.settings import model, overrides
from iprt.settings.methods import MethodInfo, MethodSettings, methods
from iprt.settings.model import Settings
from iprt.settings.overrides import (
    Assignment,
    changed,
    parse_assignment,
    read_settings,
    resolved,
    settings_toml,
)
from iprt.settings.presets import PRESETS, STILL, Quality

QUALITIES = get_args(Quality)


def flags(*texts: str) -> list[Assignment]:
    return [parse_assignment("--set", text) for text in texts]


def leaves(model: BaseModel, prefix: str = "") -> dict[str, Any]:
    """Dotted names and values, by walking the model itself."""
    found: dict[str, Any] = {}
    if isinstance(model, Settings):
        own = {type(group): group for group in model.of_methods}
        for name, info in methods().items():
            if info.settings is not None:
                found.update(leaves(own[info.settings], f"{name}."))
    for name in type(model).model_fields.keys() - {"of_methods"}:
        value = getattr(model, name)
        inside = isinstance(value, BaseModel)
        found.update(leaves(value, f"{prefix}{name}.") if inside else {prefix + name: value})
    return found


def test_every_field_of_the_model_is_a_setting_that_says_what_it_does() -> None:
    assert overrides.all_settings().keys() == leaves(Settings()).keys()
    for setting in overrides.all_settings().values():
        assert setting.help.endswith("."), setting.key
        assert setting.allowed, setting.key
    assert all(about.endswith(".") for about in overrides.groups().values())


def test_presets_name_settings_and_allowed_values() -> None:
    assert tuple(PRESETS) == QUALITIES
    assert resolved("balanced") == Settings()
    assert len({resolved(quality).model_dump_json() for quality in QUALITIES}) == len(QUALITIES)
    for quality, preset in PRESETS.items():
        values = leaves(resolved(quality))
        assert {key: values[key] for key in preset} == preset
    assert STILL.items() <= leaves(changed(Settings(), STILL)).items()


@pytest.mark.parametrize("quality", QUALITIES)
def test_the_printed_file_is_the_preset(quality: Quality, tmp_path: Path) -> None:
    """To the default preset it adds what the other one changes."""
    text = settings_toml(resolved(quality), "a title")
    file = tmp_path / "overrides.toml"
    file.write_text(text, encoding="utf-8")
    assert resolved("balanced", read_settings(file)) == resolved(quality)
    assert all(len(line) <= 100 for line in text.splitlines())
    comments = "".join(line for line in text.splitlines() if line.startswith("#"))
    for setting in overrides.all_settings().values():
        assert setting.help[:20] in comments


def test_a_printed_file_that_nobody_edited_leaves_presets_alone(tmp_path: Path) -> None:
    """And with one line edited, everything else is still the preset's."""
    file = tmp_path / "overrides.toml"
    text = settings_toml(resolved("balanced"), "a title")
    for edited, items in (
        (text, ()),
        (text.replace("#rays = 1\n", "rays = 7\n"), ("trace.rays=7",)),
    ):
        file.write_text(edited, encoding="utf-8")
        for quality in QUALITIES:
            assert resolved(quality, read_settings(file)) == resolved(quality, flags(*items))
    assert edited != text


def test_later_ones_win(tmp_path: Path) -> None:
    file = tmp_path / "overrides.toml"
    file.write_text("[trace]\nrays = 7\nbounces = 3\n[mask]\nsparse = false\n")
    result = resolved("accurate", [*read_settings(file), *flags("trace.rays=2", "trace.rays=9")])
    assert (result.trace.rays, result.trace.bounces, result.mask.sparse) == (9, 3, False)
    untouched = next(iter(PRESETS["accurate"].keys() - {"trace.rays", "trace.bounces"}))
    assert leaves(result)[untouched] == PRESETS["accurate"][untouched]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "trace.ray=2",
            "--set trace.ray=2: there is no setting 'trace.ray'; did you mean trace.rays?",
        ),
        ("rays=2", "did you mean trace.rays?"),
        ("atrous.Levels=2", "did you mean atrous.levels?"),
        ("foo=2", "there is no setting 'foo'; `iprt settings` lists all settings"),
        ("mask.foo=2", "there is no setting 'mask.foo'; the settings of mask are: mask."),
        ("trace=2", "'trace' is a group; its settings are: trace."),
        ("trace.rays", "--set trace.rays: expected KEY=VALUE"),
        ("=2", "expected KEY=VALUE"),
        ("trace.rays=0", "--set trace.rays=0: expected a whole number from 1 to 1024"),
        ("trace.rays=2.5", "expected a whole number from 1 to 1024"),
        ('trace.rays="2"', "expected a whole number"),
        ("mask.sparse=1", "expected true or false"),
        ("fading=nan", "expected a number from 0 to 1"),
        ("atrous.deviations=inf", "expected a number above 0 and at most 100"),
        ("method=ipbl", '--set method=ipbl: expected "iprt" or "dit"'),
        ("seed=99999999999", "expected a whole number from 0 to 2147483647"),
    ],
)
def test_what_is_not_allowed_is_one_line(text: str, message: str) -> None:
    with pytest.raises(IprtError) as error:
        resolved("balanced", flags(text))
    assert message in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("[trace]\nrays = 0\n", "overrides.toml: trace.rays = 0: expected a whole number from 1"),
        ("trace.rays = 2.0\n", "overrides.toml: trace.rays = 2.0: expected a whole number"),
        ("[trace]\nraiz = 1\n", "there is no setting 'trace.raiz'; did you mean trace.rays?"),
        ("[tracing]\nrays = 1\n", "there is no setting 'tracing'"),
        ("[trace.rays]\na = 1\n", "overrides.toml: trace.rays = {...}: expected a whole number"),
        ("[trace\n", "overrides.toml: not valid TOML"),
        (b"\xff\xfe", "overrides.toml: line 1 is not UTF-8"),
        (None, "overrides.toml: cannot be read: No such file"),
    ],
)
def test_faults_of_a_file_name_it_and_the_key(
    content: str | bytes | None, message: str, tmp_path: Path
) -> None:
    file = tmp_path / "overrides.toml"
    if content is not None:
        file.write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(IprtError) as error:
        resolved("balanced", read_settings(file))
    assert message in str(error.value)
    assert "\n" not in str(error.value)


class Inner(BaseModel):
    """About the inner ones."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    pair: tuple[float, int] = Field(default=(1.0, 2), description="Two numbers.")
    count: Literal["auto"] | int = Field(default="auto", description="A number or a word.")
    least: int = Field(default=3, ge=1, description="At least one.")


class Outer(MethodSettings):
    """About the group."""

    inner: Inner = Inner(least=5)
    name: str = Field(default="a\nb", description="A text.")


@pytest.fixture
def method_with_settings(monkeypatch: pytest.MonkeyPatch) -> Any:
    info = MethodInfo("outer", "A method", "nowhere:Nothing", settings=Outer)
    for module in (model, overrides):
        monkeypatch.setattr(module, "methods", lambda: {**methods(), "outer": info})
    overrides.all_settings.cache_clear()
    overrides.groups.cache_clear()
    overrides._walk.cache_clear()
    yield
    overrides.all_settings.cache_clear()
    overrides.groups.cache_clear()
    overrides._walk.cache_clear()


@pytest.mark.usefixtures("method_with_settings")
def test_methods_have_settings_of_any_kind(tmp_path: Path) -> None:
    """Groups in groups, lists, unions: nothing is known of the fields but what the model says."""
    assert list(overrides.all_settings())[-4:] == [
        "outer.name",
        "outer.inner.pair",
        "outer.inner.count",
        "outer.inner.least",
    ]
    assert overrides.all_settings()["outer.inner.least"].default == 5
    assert overrides.all_settings()["outer.inner.count"].allowed == '"auto" or a whole number'
    result = resolved("balanced", flags("outer.inner.pair=[3, 4]", "outer.inner.count=9"))
    assert result.own(Outer) == Outer(inner=Inner(pair=(3.0, 4), count=9, least=5))
    file = tmp_path / "overrides.toml"
    file.write_text(settings_toml(result, "title"))
    assert resolved("balanced", read_settings(file)) == result
    with pytest.raises(IprtError, match='expected "auto" or a whole number'):
        resolved("balanced", flags("outer.inner.count=many"))
    with pytest.raises(IprtError, match=r"expected a list of \[a number, a whole number\]"):
        resolved("balanced", flags("outer.inner.pair=[1]"))


def test_a_method_brings_its_defaults() -> None:
    """They give way to presets, files and flags, and go with the method."""
    published = resolved("balanced", flags("method=iprt2023"))
    assert published.trace.bounces == 1
    assert Settings(method="iprt2023") == published
    assert resolved("balanced", flags("trace.bounces=3", "method=iprt2023")).trace.bounces == 3
    accurate = resolved("accurate", flags("method=iprt2023"))
    assert accurate.trace.object_rays == PRESETS["accurate"]["trace.object_rays"]
    assert changed(published, {"method": "iprt"}) == Settings()
    kept = changed(changed(Settings(), {"trace.rays": 7}), {"method": "iprt2023"})
    assert (kept.trace.rays, kept.trace.bounces) == (7, 1)


def test_the_verb_prints_what_file_and_flags_come_to(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["settings", "--quality", "draft", "--set", "seed=5"]) == 0
    file = tmp_path / "overrides.toml"
    file.write_text(capsys.readouterr().out)
    assert resolved("balanced", read_settings(file)) == resolved("draft", flags("seed=5"))
    assert cli.main(["settings", "--settings", str(file), "--set", "trace.rays=3"]) == 0
    assert tomllib.loads(capsys.readouterr().out)["trace"]["rays"] == 3


@pytest.mark.parametrize("verb", ["render", "compare", "bench"])
def test_all_verbs_take_settings_and_refuse_bad_ones(
    verb: str, scene: Path, tmp_path: Path, fails: Callable[..., str]
) -> None:
    output = ["-o", tmp_path / "a.png"] if verb == "render" else []
    line = fails(verb, scene, *output, "--quality", "draft", "--set", "trace.rays=0")
    assert "--set trace.rays=0: expected a whole number from 1 to 1024" in line
    line = fails(verb, scene, *output, "--method", "ibl", "--set", "method=iprt")
    assert "--set method=iprt and --method ibl: give one of them" in line


@pytest.mark.parametrize("verb", ["render", "compare"])
def test_fading_of_a_still_picture_is_refused(
    verb: str, scene: Path, tmp_path: Path, fails: Callable[..., str]
) -> None:
    output = ["-o", tmp_path / "a.png"] if verb == "render" else []
    line = fails(verb, scene, *output, "--set", "fading=0.5")
    assert "--set fading=0.5: has no effect on a still picture" in line
