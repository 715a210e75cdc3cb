"""The figures of a run, together in one folder, as a paper or a talk takes them."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from hippodrome._files import write_atomically
from hippodrome.core.types import HippodromeError
from hippodrome.eval.results.model import read_results

KINDS: Final = (".pdf", ".svg", ".png")  # vectors first


def export_figures(out: Path, into: Path) -> tuple[str, ...]:
    """Copy each figure of each scenario of a run to ``into``, named by both; the lines that say what was written and what is not.

    Args:
        out: The folder with ``results.json``.
        into: A folder that does not exist, or is empty.

    Raises:
        HippodromeError: The results cannot be read, there are no figures, or ``into`` has something in it.
    """
    names = [one.name for one in read_results(out / "results.json").scenarios]
    folders = [out / name for name in names if Path(name).name == name]
    figures = [path for folder in folders for path in sorted(folder.glob("*.png"))]
    if not figures:
        raise HippodromeError(f"{out}: no figures below it; `hippodrome eval` draws them, and `hippodrome sweep` does not")
    if into.is_dir() and any(into.iterdir()):
        raise HippodromeError(f"{into}: not empty; nothing is overwritten, so name a new folder")
    into.mkdir(parents=True, exist_ok=True)
    written = dict.fromkeys(KINDS, 0)
    for figure in figures:
        for kind in KINDS:
            source = figure.with_suffix(kind)
            if source.exists():
                write_atomically(into / f"{figure.parent.name}-{source.name}", source.read_bytes())
                written[kind] += 1
    counts = ", ".join(f"{count} {kind[1:].upper()}" for kind, count in written.items())
    return (f"{into}: {counts} of {len(figures)} figures", *_missing(written))


def _missing(written: dict[str, int]) -> list[str]:
    """Why some figures have fewer formats than others."""
    if written[".pdf"] < written[".svg"]:
        return [
            "figures of runs by earlier versions have no PDF; the page's own PDF buttons make them, or run the scenario again"
        ]
    return ["figures made of camera frames are PNG only"] if written[".pdf"] < written[".png"] else []
