"""Controls: every setting has one, whatever the model says of it, and none gives a bad value."""

from __future__ import annotations

import tomllib
from typing import Any, Literal, get_args

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, create_model

from iprt.errors import IprtError
from iprt.settings.model import Settings
from iprt.settings.overrides import (
    Assignment,
    Setting,
    all_settings,
    changed,
    plain_values,
    resolved,
    settings_toml,
)
from iprt.settings.presets import PRESETS, Quality
from iprt.viewer.controls import (
    Control,
    control_groups,
    control_of,
    controls,
    preset_of,
    slider_of,
    value_of,
    with_preset,
    with_value,
)

QUALITIES = get_args(Quality)
SLIDERS = [c for c in controls().values() if c.sliders]
POSITIONS = st.floats(0.0, 1.0)


def values(control: Control) -> st.SearchStrategy[Any]:
    """What a user can set it to by its slider, switch or list."""
    if control.kind == "switch":
        return st.booleans()
    if control.kind == "choice":
        return st.sampled_from(control.choices)
    return POSITIONS.map(control.sliders[0].value)


def test_every_setting_has_a_control_in_its_group() -> None:
    groups = control_groups()
    assert [c.key for group in groups for c in group.controls] == list(all_settings())
    for group in groups:
        assert group.about.endswith(".")
        assert all(c.key.rpartition(".")[0] == group.name for c in group.controls)
    for key, control in controls().items():
        assert control.start == all_settings()[key].default
        assert control.help == all_settings()[key].help


@pytest.mark.parametrize("control", SLIDERS, ids=lambda control: control.key)
def test_ends_and_default_of_every_slider_are_reached_and_allowed(control: Control) -> None:
    (slider,) = control.sliders
    assert slider.low < control.start <= slider.high or control.start == slider.low
    assert (slider.value(0.0), slider.value(1.0)) == (slider.low, slider.high)
    for position in (0.0, 0.25, 0.5, 1.0):
        value = slider.value(position)
        assert isinstance(value, int if control.kind == "integer" else float)
        assert value_of(with_value(Settings(), control.key, value), control.key) == value


def test_sliders_over_decades_are_logarithmic() -> None:
    """Equal steps multiply: the middle of 1 to 100 is 10, of 16 to 2048 their geometric mean."""
    assert controls()["trace.rays"].sliders[0].value(0.5) == 10
    assert controls()["irradiance.rows"].sliders[0].value(0.5) == round((16 * 2048) ** 0.5)
    assert controls()["fading"].sliders[0].value(0.5) == 0.5
    assert not controls()["temporal.normal_agreement"].sliders[0].logarithmic


def test_units_are_those_of_the_model_and_of_a_printed_file() -> None:
    assert controls()["trace.thickness"].unit == "m"
    assert controls()["mask.sigma_position"].unit == "1/m"
    printed = settings_toml(Settings(), "title")
    for control in controls().values():
        assert " metres" not in control.help
        assert not control.unit or f"{control.allowed}; default" in printed
        assert control.allowed.endswith(f" {control.unit}") or not control.unit


def resolved_again(before: Settings, method: str) -> Settings:
    """A preset with another method."""
    quality = next(quality for quality in QUALITIES if resolved(quality) == before)
    return resolved(quality, [Assignment("method", method, "")])


@given(st.data())
def test_what_is_set_is_read_back_and_nothing_else_changes(data: st.DataObject) -> None:
    control = data.draw(st.sampled_from(list(controls().values())))
    before = data.draw(st.sampled_from([resolved(quality) for quality in QUALITIES]))
    value = data.draw(values(control))
    after = with_value(before, control.key, value)
    if control.key == "method":
        assert after == resolved_again(before, value)
    else:
        assert plain_values(after) == {**plain_values(before), control.key: value}
        assert with_value(after, control.key, value_of(before, control.key)) == before
    file = tomllib.loads(settings_toml(after, "title"))
    assert Settings.model_validate(file) == after


@given(
    whole=st.booleans(),
    bounds=st.tuples(st.integers(-(10**6), 10**6), st.integers(-(10**6), 10**6)),
    open_ends=st.tuples(*[st.sampled_from(["no", "exclusive", "none"])] * 2),
    at=st.floats(0.01, 0.99),
    positions=st.tuples(POSITIONS, POSITIONS),
)
def test_sliders_of_any_model_hold_what_it_allows(
    whole: bool,
    bounds: tuple[int, int],
    open_ends: tuple[str, str],
    at: float,
    positions: tuple[float, float],
) -> None:
    """Against pydantic itself, which knows nothing of sliders."""
    least, most = sorted(bounds)
    assume(most - least >= 4)
    default = least + at * (most - least)
    default = min(max(round(default), least + 1), most - 1) if whole else default
    names = {"no": ("ge", "le"), "exclusive": ("gt", "lt")}
    limits = {names[open_ends[0]][0]: least} if open_ends[0] != "none" else {}
    limits |= {names[open_ends[1]][1]: most} if open_ends[1] != "none" else {}
    field = (int if whole else float, Field(default=default, **limits))
    model = create_model("Any", x=field)
    slider = slider_of(model.model_json_schema()["properties"]["x"], default)
    adapter = TypeAdapter(model)
    for value in (slider.low, slider.high, default, *map(slider.value, positions)):
        assert adapter.validate_python({"x": value}, strict=True).x == value
        assert slider.low <= value <= slider.high
    assert (slider.value(0.0), slider.value(1.0)) == (slider.low, slider.high)
    first, second = sorted(positions)
    assert slider.value(first) <= slider.value(second)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("trace.rays", 0, "trace.rays = 0: expected a whole number from 1 to 1024 rays"),
        ("trace.rays", 2.0, "trace.rays = 2.0: expected a whole number"),
        ("trace.rays", None, "trace.rays = null: expected a whole number"),
        ("mask.sparse", 1, "mask.sparse = 1: expected true or false"),
        ("fading", float("nan"), "fading = NaN: expected a number from 0 to 1"),
        ("method", "path\ntracer", 'expected "iprt" or "dit"'),
        ("trace.raiz", 1, "there is no setting 'trace.raiz'; did you mean trace.rays?"),
        ("trace", 1, "'trace' is a group"),
    ],
)
def test_what_is_not_allowed_is_one_line(key: str, value: object, message: str) -> None:
    with pytest.raises(IprtError) as error:
        with_value(Settings(), key, value)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


class Other(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")

    pair: tuple[float, int] = Field((1.0, 2), description="Two.", json_schema_extra={"unit": "m"})
    limit: float | None = Field(None, ge=2.0, le=8.0, description="May be nothing.")
    side: Literal["left", "right"] | None = Field(None, description="Nor need this be.")
    count: Literal["auto"] | int = Field("auto", description="A word or a number.")
    free: list[float] = Field([], description="As many as one likes.")


def other(name: str) -> Control:
    schema = Other.model_json_schema()["properties"][name]
    default = Other().model_dump(mode="json")[name]
    return control_of(Setting(name, "", default, schema["description"], "such", schema))


def test_lists_and_what_may_be_nothing() -> None:
    pair = other("pair")
    assert (pair.kind, pair.unit, pair.start, pair.nullable) == ("numbers", "m", [1.0, 2], False)
    assert [slider.whole for slider in pair.sliders] == [False, True]
    limit = other("limit")
    assert (limit.kind, limit.nullable) == ("number", True)
    assert (limit.sliders[0].low, limit.start, limit.sliders[0].high) == (2.0, 5.0, 8.0)
    assert (other("side").choices, other("side").start) == (("left", "right"), "left")
    for name in ("count", "free"):
        with pytest.raises(TypeError, match=name):
            other(name)


@pytest.mark.parametrize("quality", QUALITIES)
def test_presets_are_recognised_and_what_differs_is_named(quality: Quality) -> None:
    assert preset_of(resolved(quality)).text == quality
    settings = with_value(resolved(quality), "atrous.lobe_fraction", 0.25)
    preset = preset_of(settings)
    assert (preset.quality, preset.differing) == (quality, {"atrous.lobe_fraction": (0.5, 0.25)})
    assert preset.text == f"{quality}, but atrous.lobe_fraction 0.5 -> 0.25"


@pytest.mark.parametrize("quality", QUALITIES)
def test_presets_leave_a_method_its_defaults(quality: Quality) -> None:
    published = [Assignment("method", "iprt2023", "")]
    expected = resolved(quality, published)
    assert preset_of(expected).text == f"{quality}, but method iprt -> iprt2023"
    for before in QUALITIES:
        assert with_preset(resolved(before, published), quality) == expected


def test_half_way_to_another_preset_is_the_default_one_still() -> None:
    half = dict(list(PRESETS["draft"].items())[: len(PRESETS["draft"]) // 2])
    assert preset_of(changed(Settings(), half)).quality == "balanced"


@given(st.sampled_from(QUALITIES), st.sampled_from(QUALITIES), st.integers(0, 99))
def test_a_preset_sets_what_presets_set_and_leaves_the_rest(
    before: Quality, after: Quality, seed: int
) -> None:
    own = {"seed": seed, "atrous.lobe_fraction": 0.25}
    assert with_preset(changed(resolved(before), own), after) == changed(resolved(after), own)
    touched = {key for preset in PRESETS.values() for key in preset}
    settings = with_preset(changed(resolved(before), own), after)
    assert set(preset_of(settings).differing) - touched <= own.keys()
