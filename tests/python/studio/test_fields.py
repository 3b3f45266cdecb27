# SPDX-License-Identifier: Apache-2.0
"""Every key of the schema has a field that shows its value and reads it back."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from pydantic import BaseModel

from locfuse.config import ros, scenario, schema
from locfuse.config.base import Strict
from locfuse.studio.compare import FIGURES, compared, value_of
from locfuse.studio.document import plain
from locfuse.studio.fields import Field, field_of, fields_of, read, shown

MODELS = sorted(
    {
        value
        for module in (schema, scenario, ros)
        for value in vars(module).values()
        if isinstance(value, type) and issubclass(value, Strict) and value is not Strict
    },
    key=lambda model: model.__name__,
)


def every() -> Iterator[tuple[type[BaseModel], Field]]:
    for model in MODELS:
        for field in fields_of(model):
            yield model, field


def test_every_key_says_what_it_means() -> None:
    assert [f"{model.__name__}.{f.name}" for model, f in every() if not f.help] == []


def test_every_default_is_shown_and_read_back_as_it_is() -> None:
    looked_at = 0
    for model, field in every():
        info = model.model_fields[field.name]
        if info.is_required() or field.kind in ("section", "switch", "choice", "choices"):
            continue
        value = plain(info.get_default(call_default_factory=True))
        again = read(field, shown(field, value))
        if value == "":
            assert again in (None, "")
        elif field.kind == "number" and value is not None:
            assert again == pytest.approx(value, rel=1e-11)
        else:
            assert again == value, f"{model.__name__}.{field.name}"
        looked_at += 1
    assert looked_at > 150


@pytest.mark.parametrize(
    ("model", "name", "kind", "label", "unit"),
    [
        (scenario.RangeSensor, "rate_hz", "number", "rate", "Hz"),
        (schema.Odometry, "sigma_heading_per_sqrt_m", "number", "sigma heading", "rad/√m"),
        (scenario.Scenario, "room_m", "numbers", "room", "m"),
        (scenario.Scenario, "laser", "section", "laser", ""),
        (scenario.Scenario, "anchors", "yaml", "anchors", "m"),
        (scenario.Points, "closed", "switch", "closed", ""),
        (schema.RunConfig, "use", "choices", "use", ""),
        (schema.RunConfig, "when_lost", "choice", "when lost", ""),
        (schema.Dataset, "path", "text", "path", ""),
    ],
)
def test_a_field_is_made_from_the_schema(
    model: type[BaseModel], name: str, kind: str, label: str, unit: str
) -> None:
    field = field_of(model, name)

    assert (field.kind, field.label, field.unit) == (kind, label, unit)


@pytest.mark.parametrize(
    ("kind", "text", "value"),
    [
        ("number", " 5 ", 5),
        ("number", "1e-3", 1e-3),
        ("number", "five", "five"),
        ("number", "", None),
        ("numbers", "1, 2.5", [1, 2.5]),
        ("numbers", "[1, x]", [1, "x"]),
        ("text", "", ""),
        ("yaml", "[1, 2, 90]", [1, 2, 90]),
        ("yaml", "truth", "truth"),
        ("yaml", "[1,", "[1,"),
    ],
)
def test_texts_are_read_as_what_they_mean(kind: str, text: str, value: Any) -> None:
    assert read(Field("f", kind, "f", "", ""), text) == value


def test_the_table_compares_runs_and_marks_the_best() -> None:
    counts = {"ranges": {"fused": 3, "gated": 1}}
    one = {"position_rmse_m": 0.5, "nees_in_band": 0.95, "counts": counts}
    two: dict[str, Any] = {"position_rmse_m": 0.25, "nees_in_band": None, "counts": {}}

    html = compared(["<one>", "two"], [one, two])

    assert "&lt;one&gt;" in html
    assert 'data-value="0.25">0.2500' in html.split("st-best")[1]
    assert html.count("st-best") == 1
    assert value_of(next(f for f in FIGURES if f.key == "fused"), one) == 75.0
    assert "95.0" in html
    assert "<td>-</td>" in html


def test_restarts_are_those_of_health_and_not_variances_held_at_their_bounds() -> None:
    figure = next(f for f in FIGURES if f.name == "restarts")
    assert value_of(figure, {"interventions": 7, "health": {"restarts": 2}}) == 2.0
    assert value_of(figure, {"interventions": 7, "health": None}) is None
