"""A method that takes part beside ours, as a scenario names it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import Field, model_serializer, model_validator

from hippodrome.sim.spec import Spec
from hippodrome.sim.value_words import CLASS, NEED

Layout = Literal["tum", "euroc", "kitti", "rosbag2", "mcap"]
STEREO_LAYOUTS: Final = ("euroc", "kitti")  # those that have a place for the right image
Need = Annotated[str, Field(pattern=NEED)]


class MethodSpec(Spec):
    """One method: a Python class, a program that reads files, or a program that is fed frame by frame."""

    class_: Annotated[str | None, Field(alias="class", pattern=CLASS)] = None  # my_package.my_module:MyMapper
    command: str | None = None  # of a program that reads files; {sequence} and {out} stand for folders
    stream: str | None = None  # of a program that is fed on standard input
    config: dict[str, Any] = Field(default_factory=dict)  # for the class: the fields of its own Config
    input: Layout = "tum"  # for the program that reads files: how the sequence lies there
    frame: Literal["own", "network", "metric"] | None = None  # in which a program answers; None: what a class says, or own
    axes: Literal["body", "camera"] = "body"  # of poses that a program leaves: the rear axle's, or a camera's that looks along z
    needs: tuple[Need, ...] = ()  # of a program, 640x480 for a size among them; a class declares its own
    localize: str | None = None  # command of the same kind for the second drive; {map} stands for what the first call left
    environment: Path | None = None  # requirements with hashes: {python} stands for the Python of an environment made of them
    time_limit_s: Annotated[float, Field(gt=0, le=86_400)] = 3_600.0  # for each drive
    stall_limit_s: Annotated[float, Field(gt=0)] | None = None  # without work; None: it may idle as long as it likes
    memory_limit_mb: Annotated[float, Field(ge=64)] = 8_000.0  # held by all its processes; each may reserve 16 times that
    disk_limit_mb: Annotated[float, Field(gt=0)] = 8_000.0  # of what it keeps in its folder, or has open for writing

    @model_validator(mode="before")
    @classmethod
    def _short_form(cls, data: Any) -> Any:
        """A text alone is ``exec:COMMAND``, ``stream:COMMAND``, or a class."""
        if isinstance(data, int | float | list):
            raise ValueError("must be my_package.my_module:MyClass, exec: or stream: and a command, or keys of its own")
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
        if self.class_ is not None and (unmeant := [name for name in _OF_PROGRAMS if getattr(self, name) != _default(name)]):
            raise ValueError(f"{unmeant[0]} is for programs; a class declares what it needs and how it answers")
        if "stereo" in self.needs and self.command is not None and self.input not in STEREO_LAYOUTS:
            layouts = " or ".join(STEREO_LAYOUTS)
            raise ValueError(f"input {self.input} has no place for the right image of a stereo pair; use {layouts}")
        if self.axes == "camera" and self.stream is not None:
            raise ValueError("axes is for programs that leave a file; over the stream poses are planar, of the rear axle")
        commands = [command for command in (self.command, self.stream, self.localize) if command is not None]
        if (self.environment is not None) != any("{python}" in command for command in commands):
            raise ValueError("environment and {python} go together: {python} in a command is the Python of the environment")
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
        return {fields[name].alias or name: _plain(value) for name, value in kept.items()}

    def __hash__(self) -> int:
        return hash(json.dumps(self.model_dump(), sort_keys=True, default=str))


def _plain(value: Any) -> Any:
    """A value as YAML has it."""
    return list(value) if isinstance(value, tuple) else str(value) if isinstance(value, Path) else value


_OF_PROGRAMS: Final = ("axes", "needs", "environment", "stall_limit_s")


def _default(name: str) -> Any:
    return MethodSpec.model_fields[name].default
