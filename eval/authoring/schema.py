"""``hippodrome scenario schema``: the JSON schema of a scenario, for completion and checks in an editor."""

from __future__ import annotations

import json
from typing import Any

from hippodrome.eval.authoring.keys import fields_of, is_model, meanings
from hippodrome.sim.scenario import Scenario

DIALECT = "https://json-schema.org/draft/2020-12/schema"


def scenario_schema() -> dict[str, Any]:
    """The schema, with each key's meaning as its description."""
    schema = Scenario.model_json_schema()
    words = dict(_meanings(Scenario, set()))
    for title, part in {**schema["$defs"], "Scenario": schema}.items():
        for key, field in part.get("properties", {}).items():
            if meaning := words.get(title, {}).get(key):
                field["description"] = meaning
    return {"$schema": DIALECT, **schema}


def schema_text() -> str:
    return json.dumps(scenario_schema(), indent=2, ensure_ascii=False)


def _meanings(model: type, seen: set[type]) -> list[tuple[str, dict[str, str]]]:
    """Model name and comments of its fields, of this model and of all inside it."""
    if model in seen:
        return []
    seen.add(model)
    inner = [kind for _, kind, _ in fields_of(model) if is_model(kind)]
    return [(model.__name__, meanings(model)), *(pair for kind in inner for pair in _meanings(kind, seen))]
