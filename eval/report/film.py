"""The README's film, an animated WebP: the map comes right, and the localizer finds itself in it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, Final

import cv2
import matplotlib
import numpy as np
from matplotlib import colormaps
from PIL import Image, ImageDraw, ImageFont

from hippodrome._files import write_atomically
from hippodrome.core.types import FloatArray, HippodromeError
from hippodrome.eval.figures.style import BLUE, ERROR_MAP, GREEN, ROAD, TRUTH, VERMILION
from hippodrome.eval.methods.method import SEMI_METRIC, TOPOMETRIC
from hippodrome.eval.report.belief import BELIEF_JSON, SECOND_FRAMES, Belief, SecondDrive, read_second_drive
from hippodrome.eval.report.evidence import MAP_JSON, THUMBNAILS, Layer, MapEvidence, Thumbnails, read_map_evidence
from hippodrome.eval.report.why import WITHIN_95

WIDTH, HEIGHT, SIDE = 760, 430, 280  # pixels, and of the column beside the map
FINER = 2  # drawn so many times larger and then shrunk, which smooths lines
FRAME_MS, GROW, RIGHT, FIND = 80, 38, 18, 44  # milliseconds of a frame, and frames of each part: eight seconds
AFTER_FIX_S = 35.0  # of the second drive that are shown after its first fix
WAITING: Final = 14  # frames of the last part that the localizer takes to find itself
QUALITY = 75  # of WebP
ERRORS_M = (0.1, 100.0)  # range of the colours, as in the report
UNKNOWN_M = 150.0  # a belief wider than this covers the town
LEAST_PX = 10.0  # half axis of a drawn belief at least
PALE = "#fbe5de"  # of a town in which the car could be anywhere


@dataclass(frozen=True, slots=True)
class Story:
    """All that is told."""

    evidence: MapEvidence
    second: SecondDrive
    semi: Layer
    refined: Layer
    belief: Belief
    films: tuple[Any, Any]  # sheets of frames of both drives, RGB


def draw_film(run: Path, name: str, path: Path) -> None:
    """Make the film of one scenario of a finished run.

    Args:
        run: Folder of the run.
        name: The scenario's name.
        path: The WebP.

    Raises:
        HippodromeError: A file is missing or not readable, or a map failed.
    """
    story = _read(run / name)
    pictures = [Image.fromarray(picture) for picture in _pictures(story)]
    buffer = BytesIO()
    pictures[0].save(
        buffer, "WEBP", save_all=True, append_images=pictures[1:], duration=FRAME_MS, loop=0, quality=QUALITY, method=4
    )
    write_atomically(path, buffer.getvalue())


def _read(folder: Path) -> Story:
    evidence, second = read_map_evidence(folder / MAP_JSON), read_second_drive(folder / BELIEF_JSON)
    layers = {layer.name: layer for layer in evidence.methods}
    beliefs = {belief.name: belief for belief in second.beliefs}
    missing = [label for label in (SEMI_METRIC.label, TOPOMETRIC.label) if label not in layers]
    if missing or TOPOMETRIC.label not in beliefs:
        raise HippodromeError(f"{folder}: no map '{(missing or [TOPOMETRIC.label])[0]}', for it failed; choose another scenario")
    sheets = [cv2.imread(str(folder / file)) for file in (THUMBNAILS, SECOND_FRAMES)]
    first, second_sheet = sheets
    if first is None or second_sheet is None:
        raise HippodromeError(f"{folder}: no frames to show; run `hippodrome eval` again")
    semi, refined = layers[SEMI_METRIC.label], layers[TOPOMETRIC.label]
    if len(semi.t_s) != len(refined.t_s):
        raise HippodromeError(f"{folder}: the two maps have not the same vertices; choose another scenario")
    return Story(evidence, second, semi, refined, beliefs[TOPOMETRIC.label], (first[:, :, ::-1], second_sheet[:, :, ::-1]))


def _pictures(story: Story) -> Iterator[Any]:
    """The frames of the film, RGB."""
    stage = _Stage(story)
    end_s = story.evidence.truth.t_s[-1]
    for step in range(GROW):
        yield stage.growing(end_s * (step + 1) / GROW)
    for step in range(RIGHT):
        yield stage.coming_right((step + 1) / (RIGHT - 4))
    belief = story.belief
    fix_s = next((t_s for t_s, known in zip(belief.t_s, belief.localized, strict=True) if known), belief.t_s[-1])
    last_s = min(fix_s + AFTER_FIX_S, belief.t_s[-1])
    for t_s in np.concatenate([np.linspace(belief.t_s[0], fix_s, WAITING), np.linspace(fix_s, last_s, FIND - WAITING)]):
        yield stage.finding(float(t_s))


class _Stage:
    """What a frame is drawn with: the roads, drawn once, and the scale."""

    def __init__(self, story: Story) -> None:
        self._story = story
        paths = (story.evidence.truth, story.semi, story.refined)
        low, high = (
            np.array([pick([pick(one.x_m) for one in paths]), pick([pick(one.y_m) for one in paths])]) for pick in (min, max)
        )
        room = np.array([WIDTH - SIDE - 40, HEIGHT - 40]) * FINER
        self._scale = float((room / np.maximum(high - low, 1.0)).min())
        self._middle = np.array([(WIDTH - SIDE) / 2, HEIGHT / 2]) * FINER - self._scale * np.array([1.0, -1.0]) * (low + high) / 2
        fonts = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
        self._fonts = [
            ImageFont.truetype(str(fonts / f"{name}.ttf"), size * FINER)
            for name, size in (("DejaVuSans-Bold", 19), ("DejaVuSans", 15))
        ]
        self._colours = (255 * colormaps[ERROR_MAP](np.linspace(0.0, 1.0, 32))[:, :3]).astype(int)

    def growing(self, t_s: float) -> Any:
        """The first drive: the semi-metric map beside the true path."""
        story, (picture, pen) = self._story, self._blank("white")
        truth = story.evidence.truth
        self._line(pen, self._path(truth.t_s, truth.x_m, truth.y_m, t_s), TRUTH, 1.6)
        self._dots(pen, self._path(story.semi.t_s, story.semi.x_m, story.semi.y_m, t_s), BLUE)
        self._car(pen, self._at(truth.t_s, truth.x_m, truth.y_m, t_s), TRUTH)
        error_m = _before(story.semi.t_s, story.semi.error_m, t_s)
        words = [
            "A map from one camera",
            "and wheel odometry:",
            "right in its connections,",
            f"{error_m:.0f} m off in its metres",
        ]
        return self._finish(picture, pen, 0, t_s, "1  The map grows", words)

    def coming_right(self, share: float) -> Any:
        """Every vertex moves to its place on the roads and takes the colour of its error."""
        story, (picture, pen) = self._story, self._blank("white")
        semi, refined = (np.array([one.x_m, one.y_m]).T for one in (story.semi, story.refined))
        along = np.clip(1.8 * share - 0.8 * np.arange(len(semi)) / len(semi), 0.0, 1.0)
        along = along * along * (3.0 - 2.0 * along)
        places = self._screen(semi + along[:, None] * (refined - semi))
        errors_m = np.array([error if error is not None else ERRORS_M[0] for error in story.refined.error_m])
        level = np.log(np.clip(errors_m, *ERRORS_M) / ERRORS_M[0]) / np.log(ERRORS_M[1] / ERRORS_M[0])
        for place, tone, arrived in zip(places, self._colours[(31 * level).astype(int)], along > 0.97, strict=True):
            self._dots(pen, place[None], tuple(int(value) for value in tone) if arrived else BLUE)
        words = ["The road network pulls", "every vertex to its place:", f"{errors_m.mean():.2f} m off in the mean"]
        return self._finish(picture, pen, 0, story.evidence.truth.t_s[-1], "2  It comes right", words)

    def finding(self, t_s: float) -> Any:
        """The second drive: from anywhere to the fix, and on."""
        story, belief = self._story, self._story.belief
        step = max(int(np.searchsorted(belief.t_s, t_s + 1e-6)) - 1, 0)
        known, spread = belief.localized[step], belief.covariance_m2[step]
        axes = _ellipse(spread) if spread is not None else None
        wide = not known and (axes is None or axes[0] > UNKNOWN_M)
        picture, pen = self._blank(PALE if wide else "white")
        self._dots(pen, self._screen(np.array([story.refined.x_m, story.refined.y_m]).T), "#8a949e", 1.3)
        truth, tone = story.second.truth, GREEN if known else VERMILION
        self._line(pen, self._path(truth.t_s, truth.x_m, truth.y_m, t_s), TRUTH, 1.8)
        self._car(pen, self._at(truth.t_s, truth.x_m, truth.y_m, t_s), TRUTH)
        if not wide and axes is not None:
            centre = (
                self._at(belief.t_s, belief.x_m, belief.y_m, t_s)
                if known
                else self._screen(np.array([[belief.x_m[step], belief.y_m[step]]]))[0]
            )
            self._belief(pen, centre, axes, tone)
        error_m = belief.error_m[step]
        told = "localized" if known else "it could be anywhere"
        words = ["A second drive begins somewhere.", f"{t_s - belief.t_s[0]:.1f} s: {told}"]
        words += [f"truly {error_m:.2f} m off"] if known and error_m is not None else []
        return self._finish(picture, pen, 1, t_s, "3  The car finds itself", words)

    def _blank(self, tone: str) -> tuple[Image.Image, Any]:
        picture = Image.new("RGB", (WIDTH * FINER, HEIGHT * FINER), "white")
        pen = ImageDraw.Draw(picture)
        pen.rectangle((0, 0, (WIDTH - SIDE) * FINER, HEIGHT * FINER), fill=tone)
        for road in self._story.evidence.roads:
            self._line(pen, self._screen(np.reshape(road, (-1, 2))), ROAD, 4.0)
        pen.rectangle(((WIDTH - SIDE) * FINER, 0, WIDTH * FINER, HEIGHT * FINER), fill="white")
        return picture, pen

    def _screen(self, places_m: FloatArray) -> FloatArray:
        places: FloatArray = self._middle + self._scale * np.array([1.0, -1.0]) * places_m
        return places

    def _path(self, times_s: list[float], x_m: list[float], y_m: list[float], until_s: float) -> FloatArray:
        count = int(np.searchsorted(times_s, until_s, "right"))
        return self._screen(np.array([x_m[:count], y_m[:count]]).T.reshape(-1, 2))

    def _at(self, times_s: list[float], x_m: list[float], y_m: list[float], t_s: float) -> FloatArray:
        place: FloatArray = self._screen(np.array([[np.interp(t_s, times_s, x_m), np.interp(t_s, times_s, y_m)]]))[0]
        return place

    def _line(self, pen: Any, places: FloatArray, tone: str, width: float) -> None:
        if len(places) > 1:
            pen.line([tuple(place) for place in places], fill=tone, width=round(width * FINER), joint="curve")

    def _dots(self, pen: Any, places: FloatArray, tone: Any, size: float = 2.2) -> None:
        reach = size * FINER
        for x, y in places:
            pen.ellipse((x - reach, y - reach, x + reach, y + reach), fill=tone)

    def _car(self, pen: Any, place: FloatArray, tone: str) -> None:
        for size, colour in ((6.5, "white"), (5.0, tone)):
            self._dots(pen, place[None], colour, size)

    def _belief(self, pen: Any, centre: FloatArray, axes: tuple[float, float, float], tone: str) -> None:
        """The ellipse that holds 95 % of the belief."""
        angle = np.linspace(0.0, 2.0 * np.pi, 48)
        a, b = (max(half_m * self._scale, LEAST_PX * FINER) for half_m in axes[:2])
        along, across = a * np.cos(angle), b * np.sin(angle)
        cos, sin = np.cos(axes[2]), np.sin(axes[2])
        places = centre + np.array([along * cos - across * sin, -(along * sin + across * cos)]).T
        self._line(pen, places, tone, 2.4)

    def _finish(self, picture: Image.Image, pen: Any, drive: int, t_s: float, title: str, words: list[str]) -> Any:
        """Frame and words beside the map, everything shrunk to its size."""
        tiles = (self._story.evidence.thumbnails, self._story.second.frames)[drive]
        width, left = (SIDE - 28) * FINER, (WIDTH - SIDE + 14) * FINER
        tile = Image.fromarray(_tile(self._story.films[drive], tiles, t_s))
        picture.paste(tile.resize((width, width * tiles.height // tiles.width), Image.Resampling.BICUBIC), (left, 16 * FINER))
        top = (16 + (SIDE - 28) * tiles.height / tiles.width + 14) * FINER
        for place, line in enumerate((title, *words)):
            pen.text((left, top + 26 * FINER * place), line, fill=TRUTH, font=self._fonts[min(place, 1)])
        return np.asarray(picture.resize((WIDTH, HEIGHT), Image.Resampling.BOX))


def _tile(sheet: Any, tiles: Thumbnails, t_s: float) -> Any:
    number = int(np.abs(np.array(tiles.t_s) - t_s).argmin())
    top, left = tiles.height * (number // tiles.columns), tiles.width * (number % tiles.columns)
    return np.ascontiguousarray(sheet[top : top + tiles.height, left : left + tiles.width])


def _before(times_s: list[float], values: list[float | None], t_s: float) -> float:
    """The value that was known last."""
    known = [value for time_s, value in zip(times_s, values, strict=True) if time_s <= t_s and value is not None]
    return known[-1] if known else 0.0


def _ellipse(spread: tuple[float, float, float]) -> tuple[float, float, float]:
    """Half axes in metres and direction of the ellipse that holds 95 %."""
    xx, xy, yy = spread
    middle, apart = (xx + yy) / 2.0, float(np.hypot((xx - yy) / 2.0, xy))
    long_m, short_m = (WITHIN_95 * float(np.sqrt(max(value, 0.0))) for value in (middle + apart, middle - apart))
    return long_m, short_m, float(np.arctan2(2.0 * xy, xx - yy) / 2.0)
