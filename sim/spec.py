"""Base of the scenario's models: frozen, unknown keys rejected. Each model is declared beside the code that it configures, in a
module that loads none of it: a fault in a scenario is told before a simulator or an algorithm is loaded."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, GetCoreSchemaHandler
from pydantic_core import CoreSchema

from hippodrome.sim.limits import limit_numbers


class Spec(BaseModel):
    """A part of a scenario. Defaults live in the subclasses only; YAML holds overrides. Every number has limits."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        schema = handler(source)
        limit_numbers(schema, handler.resolve_ref_schema)
        return schema
