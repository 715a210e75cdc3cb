"""The tables of docs/scenarios.md, made from the models. ``python -m hippodrome.eval.authoring.reference docs/scenarios.md``."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from hippodrome._files import write_atomically
from hippodrome.eval.authoring.keys import Key, noise_keys, scenario_keys
from hippodrome.eval.results.markdown import table
from hippodrome.sim.self_motion import NOISE_LEVELS

BEGIN: Final = "<!-- tables: made from the models by `make docs` -->"
END: Final = "<!-- end of tables -->"
UNITS: Final = {  # units by the ends of fields' names, longer ends first
    "nats_per_rad": "nats/rad",
    "deg_per_sqrt_s": "deg/√s", "rad_per_sqrt_s": "rad/√s", "per_sqrt_s": "1/√s", "per_sqrt_m": "1/√m", "per_metre": "1/m",
    "mps2": "m/s²", "radps": "rad/s", "degps": "deg/s", "mps": "m/s", "km": "km", "deg": "deg", "rad": "rad", "hz": "Hz",
    "px": "px", "nats": "nats", "s": "s", "m": "m",
}  # fmt: skip
HEADS: Final = {
    "": "The scenario", "town": "`town`: where to drive", "camera": "`camera`: what is seen",
    "mapping": "`mapping` and `localization`: the two drives", "missions": "`missions`: goals to drive to",
    "thresholds": "`thresholds`: when `hippodrome eval`, `drive` and `gate` exit with 1",
    "mapper": "`mapper`: from frames to a semi-metric map", "refine": "`refine`: from semi-metric to topometric",
    "localizer": "`localizer`: where am I in the map",
}  # fmt: skip


def reference_markdown() -> str:
    """All tables, the short ones that one sets by hand first."""
    keys = scenario_keys()
    tables = []
    for part, title in HEADS.items():
        chosen = [key for key in keys if (key.path[0] if len(key.path) > 1 else "") == part]
        tables.append(f"## {title}\n\n{_table(chosen)}\n")
        if part == "":
            tables.append(_noise_table())
    return "\n".join(tables)


def with_tables(text: str) -> str:
    """A document with the part between ``BEGIN`` and ``END`` made anew."""
    before, rest = text.split(BEGIN, maxsplit=1)
    _, after = rest.split(END, maxsplit=1)
    return f"{before}{BEGIN}\n\n{reference_markdown()}\n{END}{after}"


def _table(keys: Sequence[Key]) -> str:
    """One row a key, in the order of the models."""
    rows = [[f"`{key.name}`", _takes(key), _default(key), _unit(key.path[-1]), key.meaning] for key in keys]
    return "\n".join(table(("key", "takes", "default", "unit", "meaning"), rows, align="left"))


def _noise_table() -> str:
    """One row a key, one column a named level."""
    levels = {name: level.model_dump() for name, level in NOISE_LEVELS.items()}
    rows = [
        [f"`{key.name}`", *(_value(level[key.path[-1]]) for level in levels.values()), _unit(key.path[-1]), key.meaning]
        for key in noise_keys()
    ]
    lines = table(["key", *levels, "unit", "meaning"], rows, align="left")
    words = "A level's name, or these figures; those left out have the default of `clean`."
    return f"## `noise`: errors of self-motion\n\n{words}\n\n" + "\n".join(lines) + "\n"


def _default(key: Key) -> str:
    return "must be given" if key.path == ("name",) else _value(key.default)


def _takes(key: Key) -> str:
    return f"{key.kind}, {key.limits}" if key.limits else key.kind


def _value(value: Any) -> str:
    """A value as people write it in YAML."""
    if value is None:
        return "null"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return f"{value:.6g}"
    if isinstance(value, list | tuple):
        return ", ".join(_value(part) for part in value)
    return str(value) or "empty"


def _unit(name: str) -> str:
    """The unit that a field's name ends with; empty if it has none."""
    return next((unit for ending, unit in UNITS.items() if name.endswith(f"_{ending}")), "")


if __name__ == "__main__":
    document = Path(sys.argv[1])
    write_atomically(document, with_tables(document.read_text(encoding="utf-8")).encode())
