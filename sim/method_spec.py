"""A method that takes part beside ours, as a scenario names it."""

from __future__ import annotations

import json
from typing import Annotated, Any, Literal

from pydantic import Field, model_serializer, model_validator

from hippodrome.sim.spec import Spec

Layout = Literal["tum", "euroc", "kitti", "rosbag2", "mcap"]


class MethodSpec(Spec):
    """One method: a Python class, a program that reads files, or a program that is fed frame by frame."""

    class_: Annotated[str | None, Field(alias="class", pattern=r"^[\w.]+:[\w.]+$")] = None  # my_package.my_module:MyMapper
    command: str | None = None  # of a program that reads files; {sequence} and {out} stand for folders
    stream: str | None = None  # of a program that is fed on standard input
    config: dict[str, Any] = Field(default_factory=dict)  # for the class: the fields of its own Config
    input: Layout = "tum"  # for the program that reads files: how the sequence lies there
    frame: Literal["own", "network", "metric"] | None = None  # in which a program answers; None: what a class says, or own
    needs: tuple[Literal["road_network", "start_pose"], ...] = ()  # of a program; a class declares its own
    localize: str | None = None  # command of the same kind for the second drive; {map} stands for what the first call left
    time_limit_s: Annotated[float, Field(gt=0, le=86_400)] = 3_600.0  # for each drive
    memory_limit_mb: Annotated[float, Field(ge=64)] = 8_000.0  # address space of each of its processes

    @model_validator(mode="before")
    @classmethod
    def _short_form(cls, data: Any) -> Any:
        """A text alone is ``exec:COMMAND``, ``stream:COMMAND``, or a class."""
        if not isinstance(data, str):
            return data
        kind, _, rest = data.partition(":")
        return {"command": rest} if kind == "exec" else {"stream": rest} if kind == "stream" else {"class": data}

    @model_validator(mode="after")
    def _one_way_in(self) -> MethodSpec:
        if sum(way is not None for way in (self.class_, self.command, self.stream)) != 1:
            raise ValueError("a method has one of the keys class, command and stream")
        if self.command is not None and not ("{sequence}" in self.command and "{out}" in self.command):
            raise ValueError("a command names the folders {sequence} and {out}, as in './run.sh {sequence} {out}'")
        if self.localize is not None and self.class_ is not None:
            raise ValueError("localize is a command, for programs; a class has a function of this name")
        if (
            self.localize is not None
            and self.command is not None
            and not all(name in self.localize for name in ("{sequence}", "{map}", "{out}"))
        ):
            raise ValueError("localize names the folders {sequence}, {map} and {out}, as in './run.sh {sequence} {map} {out}'")
        return self

    @model_serializer(mode="plain")
    def _as_written(self) -> dict[str, Any]:
        """Only what differs from the defaults, under the names of the file: it reads back as the same method."""
        fields = type(self).model_fields
        values = {name: getattr(self, name) for name in fields}
        kept = {name: value for name, value in values.items() if value != fields[name].get_default(call_default_factory=True)}
        return {fields[name].alias or name: list(value) if isinstance(value, tuple) else value for name, value in kept.items()}

    def __hash__(self) -> int:
        return hash(json.dumps(self.model_dump(), sort_keys=True, default=str))
