"""``hippodrome scenario schema``: the JSON schema of a scenario, for completion and checks in an editor."""

from __future__ import annotations

import json
from typing import Any

from hippodrome.eval.authoring.keys import meanings, models
from hippodrome.sim.scenario import Scenario

DIALECT = "https://json-schema.org/draft/2020-12/schema"


def scenario_schema() -> dict[str, Any]:
    """The schema, with each key's meaning as its description."""
    schema = Scenario.model_json_schema()
    words = {model.__name__: meanings(model) for model in models(Scenario)}
    for title, part in {**schema["$defs"], "Scenario": schema}.items():
        for key, field in part.get("properties", {}).items():
            if meaning := words.get(title, {}).get(key):
                field["description"] = meaning
    return {"$schema": DIALECT, **schema}


def schema_text() -> str:
    """The schema as it is printed."""
    return json.dumps(scenario_schema(), indent=2, ensure_ascii=False)
