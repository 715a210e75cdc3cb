"""A contact sheet of frames: what the camera saw, at a glance."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hippodrome.core.types import Frame
from hippodrome.eval.figures.style import new_figure, save_figure


def draw_contact_sheet(path: Path, frames: Sequence[Frame], captions: Sequence[str], columns: int = 6, title: str = "") -> None:
    """Frames of one size in rows of ``columns``, each with a caption beneath its top edge."""
    if not frames or len(frames) != len(captions):
        raise ValueError(f"{len(frames)} frames and {len(captions)} captions: one each, at least one")
    rows = -(-len(frames) // columns)
    height, width = frames[0].shape[:2]
    figure = new_figure(1.9 * columns, 1.9 * rows * height / width + 0.2 * rows + 0.35)
    cells = np.atleast_1d(figure.subplots(rows, columns, squeeze=False)).ravel()
    for axes in cells:
        axes.set_axis_off()
    for axes, frame, caption in zip(cells, frames, captions, strict=False):
        axes.imshow(frame, cmap="gray", vmin=0, vmax=255, interpolation="nearest")
        axes.set_title(caption, fontsize=7, loc="left", pad=2.0)
    figure.suptitle(title, x=0.01, ha="left", fontsize=10)
    save_figure(figure, path)
