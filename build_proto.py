"""Hatchling build hook: generates ``proto/*_pb2.py`` from ``proto/*.proto`` at install and at wheel build."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class ProtoBuildHook(BuildHookInterface):  # type: ignore[type-arg]
    """Runs protoc with the import root mapped to ``hippodrome.proto``, so that imports in generated code are absolute."""

    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Generate the modules before files are collected."""
        from grpc_tools import protoc

        root = Path(self.root)
        files = sorted(f"hippodrome/proto/{path.name}" for path in (root / "proto").glob("*.proto"))
        arguments = [f"-Ihippodrome/proto={root / 'proto'}", f"--python_out={root / '.ns'}", f"--pyi_out={root / '.ns'}"]
        if files and protoc.main(["protoc", *arguments, *files]) != 0:
            raise RuntimeError(f"protoc failed for {', '.join(files)} in {root / 'proto'}")
