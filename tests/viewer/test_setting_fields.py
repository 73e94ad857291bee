"""Fields of settings: each has one, whatever the model says of it, and none gives a bad value."""

from __future__ import annotations

import tomllib
from types import SimpleNamespace
from typing import Any, get_args

import pydantic
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pydantic import TypeAdapter, create_model

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
    compared_presets,
    preset_of,
    slider_of,
    value_of,
    with_preset,
    with_value,
)
from iprt.viewer.fields import Field
from iprt.viewer.setting_fields import setting_field, setting_groups

QUALITIES = get_args(Quality)
POSITIONS = st.floats(0.0, 1.0)


def with_fields(settings: Settings) -> tuple[SimpleNamespace, dict[str, Field]]:
    """Settings as an interface has them, and the fields that show and change them."""
    ui: Any = SimpleNamespace(settings=settings)
    return ui, {field.key: field for _, fields in setting_groups(ui) for field in fields}


FIELDS = with_fields(Settings())[1]
SLIDERS = {key: field.slider for key, field in FIELDS.items() if field.slider is not None}


def values(field: Field) -> st.SearchStrategy[Any]:
    """What a user can set it to by its slider, switch or list."""
    if field.kind == "switch":
        return st.booleans()
    if field.kind == "choice":
        return st.sampled_from(list(field.options()))
    return POSITIONS.map(SLIDERS[field.key].value)


@pytest.mark.parametrize("key", SLIDERS)
def test_ends_and_default_of_every_slider_are_reached_and_allowed(key: str) -> None:
    slider = SLIDERS[key]
    assert slider.low <= FIELDS[key].default <= slider.high
    assert (slider.value(0.0), slider.value(1.0)) == (slider.low, slider.high)
    for position in (0.0, 0.25, 0.5, 1.0):
        value = slider.value(position)
        assert isinstance(value, int if slider.whole else float)
        assert value_of(with_value(Settings(), key, value), key) == value


def test_sliders_over_decades_are_logarithmic() -> None:
    """Equal steps multiply: the middle of 1 to 100 is 10, of 16 to 2048 their geometric mean."""
    assert SLIDERS["trace.rays"].value(0.5) == 10
    assert SLIDERS["irradiance.rows"].value(0.5) == round((16 * 2048) ** 0.5)
    assert SLIDERS["fading"].value(0.5) == 0.5


def resolved_again(before: Settings, method: str) -> Settings:
    """A preset with another method."""
    quality = next(quality for quality in QUALITIES if resolved(quality) == before)
    return resolved(quality, [Assignment("method", method, "")])


@given(st.data())
def test_what_is_set_is_read_back_and_nothing_else_changes(data: st.DataObject) -> None:
    before = data.draw(st.sampled_from([resolved(quality) for quality in QUALITIES]))
    ui, fields = with_fields(before)
    field = fields[data.draw(st.sampled_from(list(fields)))]
    value, old = data.draw(values(field)), field.read()
    field.write(value)
    after = ui.settings
    if field.key == "method":
        assert after == resolved_again(before, value)
    else:
        assert field.read() == value
        assert plain_values(after) == {**plain_values(before), field.key: value}
        field.write(old)
        assert ui.settings == before
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
    kind = int if whole else float
    model = create_model("Any", x=(kind, pydantic.Field(default=default, **limits)))
    slider = slider_of(model.model_json_schema()["properties"]["x"], default)
    adapter = TypeAdapter(model)
    for value in (slider.low, slider.high, default, *map(slider.value, positions)):
        assert adapter.validate_python({"x": value}, strict=True).x == value
        assert slider.low <= value <= slider.high
    assert (slider.value(0.0), slider.value(1.0)) == (slider.low, slider.high)
    first, second = sorted(positions)
    assert slider.value(first) <= slider.value(second)


@pytest.mark.parametrize("quality", QUALITIES)
def test_presets_are_recognised_and_what_differs_is_named(quality: Quality) -> None:
    assert preset_of(resolved(quality)).text == quality
    settings = with_value(resolved(quality), "atrous.lobe_fraction", 0.25)
    preset = preset_of(settings)
    assert (preset.quality, preset.differing) == (quality, {"atrous.lobe_fraction": (0.35, 0.25)})
    assert preset.text == f"{quality}, but atrous.lobe_fraction 0.35 -> 0.25"


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


@pytest.mark.parametrize("schema", [{"type": "array"}, {"anyOf": [{"type": "null"}]}])
def test_every_setting_has_a_field_or_is_named(schema: dict[str, Any]) -> None:
    """A model cannot gain a setting that no viewer shows."""
    ui, fields = with_fields(Settings())
    assert list(fields) == list(all_settings())
    with pytest.raises(TypeError, match="new"):
        setting_field(ui, Setting("new", "", None, "", "such", schema))


@pytest.mark.parametrize(("key", "value"), [("trace.rays", 0), ("method", "path\ntracer")])
def test_what_is_not_allowed_is_one_line(key: str, value: object) -> None:
    with pytest.raises(IprtError, match=key) as error:
        with_value(Settings(), key, value)
    assert "\n" not in str(error.value)


def test_settings_are_found_by_words_of_names_keys_and_tooltips() -> None:
    assert all(field.matches("") for field in FIELDS.values())
    assert FIELDS["trace.rays"].matches("Trace RAYS")
    found = {key for key, field in FIELDS.items() if field.matches("filter")}
    assert 0 < len(found) < len(FIELDS)
    for key in found:
        label = FIELDS[key].label()
        assert "filter" in f"{key} {label.name} {label.about}".lower()
    assert not any(field.matches("filter nonsense") for field in FIELDS.values())


def test_changed_settings_are_marked() -> None:
    ui, fields = with_fields(Settings())
    assert not any(field.changed for field in fields.values())
    ui.settings = with_preset(ui.settings, "accurate")
    changed_ones = {key for key, field in fields.items() if field.changed}
    assert changed_ones == set(PRESETS["accurate"])


def test_presets_are_compared_with_the_settings_of_now() -> None:
    """The table has each setting in which two columns differ."""
    settings = with_value(with_preset(Settings(), "draft"), "trace.caustic_clamp", 3.5)
    rows = compared_presets(settings)
    differing = {key for preset in PRESETS.values() for key in preset}
    assert set(rows) == differing | {"trace.caustic_clamp"}
    for key, row in rows.items():
        assert list(row) == [*PRESETS, "now"]
        for name in PRESETS:
            assert row[name] == str(value_of(with_preset(Settings(), name), key))
        assert row["now"] == str(value_of(settings, key))
