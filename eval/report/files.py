"""What lies beside ``results.json`` for one scenario, read for embedding."""

from __future__ import annotations

import base64
import gzip
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from hippodrome._files import read_bounded, why_unreadable
from hippodrome.eval.methods.method import REFINED
from hippodrome.eval.report.belief import BELIEF_JSON, SECOND_FRAMES, SecondDrive, read_second_drive
from hippodrome.eval.report.evidence import MAP_JSON, THUMBNAILS, MapEvidence, read_map_evidence
from hippodrome.eval.report.why import WHY_JSON, Places, read_why
from hippodrome.eval.results.kept import read_kept
from hippodrome.eval.results.model import MAX_BYTES, ResultsError
from hippodrome.eval.results.ratios import RATIOS
from hippodrome.eval.results.table_two import TABLE_TWO, SequenceRow

LOSSLESS_BYTES = 120_000  # a larger figure is mostly photographs, which lossless coding does not shrink
PHOTO_QUALITY = 88  # of WebP, for those
LOSSLESS = 101  # OpenCV codes WebP without loss if asked for a quality above 100

# By a figure's stem, or by its end if that begins with "-": then {} is the method. In the order of the page.
CAPTIONS: Final = {
    "maps": "Maps over ground truth (Fig. 3 B)",
    "semi-metric-map": "Semi-metric map as built, in map units (Fig. 3 A)",
    "errors": "Errors along the drive (Fig. 3 D–F)",
    "violins": "Distribution of errors (Fig. 3 G–I)",
    "-ape": "APE on the map, {} (Fig. 3 C)",
    "localization-methods": "Localization error of all methods on one sequence (Fig. 4 E)",
    "-localization": "Localization error over the second drive, {}",
    "neurodynamics": "Frames, grid cells and head direction while the estimate settles (Fig. 4)",
    "frames": "The mapping drive as the camera sees it",
    "stress": "Mean APE of the runs of each case",
    "robustness": "Mean error from each unknown start under each condition",
    "places": "Place recognition alone: precision over recall",
}

PHOTOS: Final = ("frames", "neurodynamics")  # figures made of camera frames


@dataclass(frozen=True, slots=True)
class Picture:
    """A figure ready for embedding."""

    caption: str
    uri: str
    width: int
    height: int
    svg: str | None = None  # the same as SVG, packed with gzip and base64; None where none was drawn
    photo: bool = False  # whether it shows camera frames, whose colours are left alone in the dark


@dataclass(frozen=True, slots=True)
class ScenarioFiles:
    """Everything of one scenario that the page embeds; what is missing is left out of the page."""

    pictures: tuple[Picture, ...]
    evidence: MapEvidence | None
    thumbnails: str | None  # data URI of the sheet
    sequences: tuple[SequenceRow, ...] = ()  # rows of Table II
    ratios: Mapping[str, Any] = field(default_factory=dict)  # content of ratios.json
    second: SecondDrive | None = None  # what the localizer believed on the second drive
    second_frames: str | None = None  # data URI of that drive's sheet
    why: Places | None = None  # what is known about the worst places of the first drive


def read_scenario_files(out: Path, name: str) -> ScenarioFiles:
    """The files below ``out / name``; a name that is no plain folder name has none.

    Raises:
        ResultsError: A file is there, but not readable.
    """
    folder = out / name
    if Path(name).name != name or not folder.is_dir():
        return ScenarioFiles((), None, None)
    figures = sorted(folder.glob("*.png"), key=lambda path: (_order(path.stem), path.stem))
    frames, second, second_frames = (folder / name for name in (THUMBNAILS, BELIEF_JSON, SECOND_FRAMES))
    return ScenarioFiles(
        tuple(picture for path in figures if (picture := read_picture(path)) is not None),
        read_map_evidence(folder / MAP_JSON) if (folder / MAP_JSON).exists() else None,
        data_uri("image/jpeg", _bytes(frames)) if frames.exists() else None,
        tuple(_parsed(folder / TABLE_TWO, list[SequenceRow]) or ()),
        _parsed(folder / RATIOS, dict[str, Any]) or {},
        read_second_drive(second) if second.exists() else None,
        data_uri("image/jpeg", _bytes(second_frames)) if second_frames.exists() else None,
        read_why(folder / WHY_JSON) if (folder / WHY_JSON).exists() else None,
    )


def _parsed(path: Path, kind: Any) -> Any:
    """A JSON file as this type, None if there is none. Raises ResultsError."""
    return read_kept(path, kind, "not readable", "run `hippodrome baselines` again") if path.exists() else None


def _bytes(path: Path) -> bytes:
    """The content of a picture. Raises ResultsError."""
    try:
        return read_bounded(path, MAX_BYTES)
    except OSError as error:
        raise ResultsError(f"{path}: cannot be read: {why_unreadable(error)}; run `hippodrome eval` again") from error


def data_uri(media_type: str, content: bytes) -> str:
    """Content as an address that holds it."""
    return f"data:{media_type};base64,{base64.b64encode(content).decode()}"


def read_picture(path: Path) -> Picture | None:
    """The figure as WebP, which takes a third of the PNG's size; without loss unless that is large. None if it is no picture.

    Photographs are not even tried without loss, which takes half of the page's time and ends in a file that is too large.
    """
    image = cv2.imdecode(np.frombuffer(_bytes(path), np.uint8), cv2.IMREAD_COLOR)
    if image is None:
        return None
    is_photo = path.stem in PHOTOS
    coded = None if is_photo else cv2.imencode(".webp", image, [cv2.IMWRITE_WEBP_QUALITY, LOSSLESS])[1]
    if coded is None or len(coded) > LOSSLESS_BYTES:
        _, coded = cv2.imencode(".webp", image, [cv2.IMWRITE_WEBP_QUALITY, PHOTO_QUALITY])
    height, width = image.shape[:2]
    return Picture(
        _caption(path.stem),
        data_uri("image/webp", coded.tobytes()),
        width,
        height,
        _packed(path.with_suffix(".svg")),
        is_photo,
    )


def _packed(path: Path) -> str | None:
    """A figure's SVG as the page unpacks it; None if there is none. The same file gives the same bytes."""
    return base64.b64encode(gzip.compress(path.read_bytes(), mtime=0)).decode() if path.exists() else None


def _kind(stem: str) -> str | None:
    """The key of ``CAPTIONS`` that a figure's stem belongs to."""
    return next((key for key in CAPTIONS if stem == key or (key.startswith("-") and stem.endswith(key))), None)


def _order(stem: str) -> int:
    kind = _kind(stem)
    return len(CAPTIONS) if kind is None else list(CAPTIONS).index(kind)


def _caption(stem: str) -> str:
    kind = _kind(stem)
    if kind is None:
        return stem.replace("-", " ")
    begin = stem.removesuffix(kind)
    return CAPTIONS[kind].format(next((method.label for method in REFINED if method.stem == begin), begin))
