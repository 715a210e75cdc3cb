"""Base of the scenario's models: frozen, unknown keys rejected. Each model is declared beside the code that it configures."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class Spec(BaseModel):
    """A part of a scenario. Defaults live in the subclasses only; YAML holds overrides."""

    model_config = ConfigDict(extra="forbid", frozen=True)
