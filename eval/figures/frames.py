"""A contact sheet of frames: what the camera saw, at a glance."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hippodrome.core.types import Frame
from hippodrome.eval.figures.style import new_figure, save_figure

GAP_PX = 4  # between frames
CAPTION_PX = 14  # above each row


def draw_contact_sheet(path: Path, frames: Sequence[Frame], captions: Sequence[str], columns: int = 6, title: str = "") -> None:
    """Frames of one size in rows of ``columns``, each with a caption above it. Raises ValueError without frames or captions."""
    if not frames or len(frames) != len(captions):
        raise ValueError(f"{len(frames)} frames and {len(captions)} captions: one each, at least one")
    sheet, corners = _mosaic(frames, columns)
    figure = new_figure(11.4, 11.4 * sheet.shape[0] / sheet.shape[1] + 0.4)
    axes = figure.subplots()  # one for all frames: an axes each would take a second of layout
    axes.set_axis_off()
    axes.imshow(sheet, interpolation="nearest")
    for (x, y), caption in zip(corners, captions, strict=True):
        axes.text(x, y - 3, caption, fontsize=7, va="bottom")
    axes.set_title(title, loc="left", fontsize=10)
    save_figure(figure, path)


def _mosaic(frames: Sequence[Frame], columns: int) -> tuple[Frame, list[tuple[int, int]]]:
    """All frames in one white RGB image, and the upper left corner (x, y) of each."""
    height, width = frames[0].shape[:2]
    rows = -(-len(frames) // columns)
    sheet = np.full((rows * (height + GAP_PX + CAPTION_PX), columns * (width + GAP_PX), 3), 255, dtype=np.uint8)
    corners = []
    for i, frame in enumerate(frames):
        x, y = (i % columns) * (width + GAP_PX), (i // columns) * (height + GAP_PX + CAPTION_PX) + CAPTION_PX
        sheet[y : y + height, x : x + width] = frame if frame.ndim == 3 else frame[:, :, None]
        corners.append((x, y))
    return sheet, corners
