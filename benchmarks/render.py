"""Frames of a generated town: ours, stock pyrender as its manual shows it, and raw moderngl on the same tiles.

Process CPU time per frame, medians over the same poses; llvmpipe draws in the calling thread (LP_NUM_THREADS=0), so that
CPU time covers the drawing. With a real GPU the figures measure the driver's overhead only.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from benchmarks.table import Row
from hippodrome.core.types import FloatArray, Frame
from hippodrome.sim.render.camera import FAR_M, CameraSpec, camera_position_m, camera_to_world, projection
from hippodrome.sim.render.flat import VERTEX_DTYPE, VERTEX_SHADER, fragment_shader, visible_tiles
from hippodrome.sim.render.gl import pyrender
from hippodrome.sim.render.renderer import FINE_DETAIL_M, FrameRenderer
from hippodrome.sim.scene.build import build_scene
from hippodrome.sim.scene.conditions_spec import Conditions
from hippodrome.sim.scene.light import DOME_RADIUS_M
from hippodrome.sim.scene.types import Scene, Tile
from hippodrome.sim.town import build_town
from hippodrome.sim.town_spec import TownSpec
from hippodrome.sim.types import Town

SIZES = ((160, 120), (320, 240), (640, 480))
FRAMES = 60
NAIVE_FRAMES = 12
Draw = Callable[[FloatArray], Frame]


def run() -> list[Row]:
    with tempfile.TemporaryDirectory() as folder:
        town = build_town(TownSpec(), 1, Path(folder))
        began = time.process_time()
        scene = build_scene(town, 1, Conditions())
        rows = [Row("scene", f"build, {_road_km(town):.1f} km of lanes", time.process_time() - began, "s CPU")]
    rows.append(Row("scene", "triangles", sum(len(tile.faces) for tile in scene.tiles), ""))
    poses = _poses(town, FRAMES)
    for width, height in SIZES:
        rows += _compare(scene, CameraSpec(width=width, height=height), poses)
    return rows


def _compare(scene: Scene, camera: CameraSpec, poses: FloatArray) -> list[Row]:
    with FrameRenderer(scene, camera) as renderer:
        ours, our_frames = _measure(renderer.render, poses)
    raw, raw_frames = _moderngl(scene, camera, poses)
    naive, naive_frames = _naive(scene, camera, poses[:NAIVE_FRAMES])
    size = f"{camera.width}x{camera.height}"
    difference = float(np.mean(np.abs(our_frames.astype(int) - raw_frames)))
    naive_difference = float(np.mean(np.abs(our_frames[:NAIVE_FRAMES].astype(int) - naive_frames)))
    return [
        Row("render", f"{size} ours", 1e3 * ours, "ms CPU", f"supersampled {camera.supersample}x, {1.0 / ours:.0f} frames/s"),
        Row("render", f"{size} naive pyrender", 1e3 * naive, "ms CPU", "from_trimesh tiles, lit, multisampled"),
        Row("render", f"{size} raw moderngl", 1e3 * raw, "ms CPU", "same tiles, same culling, same supersampling"),
        Row("render", f"{size} speed against naive", naive / ours, "x"),
        Row("render", f"{size} speed against moderngl", raw / ours, "x"),
        Row("render", f"{size} difference to moderngl", difference, "levels", "mean absolute, of 255"),
        Row("render", f"{size} difference to naive", naive_difference, "levels", "lights the baked colours again, has no haze"),
    ]


def _measure(draw: Draw, poses: FloatArray) -> tuple[float, np.ndarray]:
    """Median CPU seconds per frame, and the frames. A first pass uploads the tiles and compiles the shaders."""
    frames = np.stack([draw(pose) for pose in poses])
    seconds = []
    for pose in poses:
        began = time.process_time()
        draw(pose)
        seconds.append(time.process_time() - began)
    return float(np.median(seconds)), frames


def _poses(town: Town, count: int) -> FloatArray:
    """Evenly spread over the lanes, in driving direction."""
    network = town.network
    lanes = np.flatnonzero(~network.is_internal & (network.lane_lengths_m() > 10.0))
    poses = []
    for lane in lanes[np.linspace(0, len(lanes) - 1, count).astype(int)]:
        points = network.lane_points_m(int(lane))
        step = points[1] - points[0]
        poses.append([*(0.5 * (points[0] + points[1])), np.arctan2(step[1], step[0])])
    return np.array(poses)


def _road_km(town: Town) -> float:
    return float(town.network.lane_lengths_m()[~town.network.is_internal].sum()) / 1000.0


def _naive(scene: Scene, camera: CameraSpec, poses: FloatArray) -> tuple[float, np.ndarray]:
    """Stock pyrender: a node per tile, physically based shading, no culling, multisampled, depth read back."""
    import trimesh

    stock = pyrender.Scene(bg_color=[*(scene.haze_rgb / 255.0), 1.0], ambient_light=[0.4, 0.4, 0.4])
    for tile in scene.tiles:
        mesh = trimesh.Trimesh(tile.vertices_m, tile.faces, vertex_colors=tile.rgb, process=False)
        stock.add(pyrender.Mesh.from_trimesh(mesh, smooth=False))
    stock.add(pyrender.DirectionalLight(intensity=3.0), pose=np.diag([1.0, -1.0, -1.0, 1.0]))
    yfov = 2.0 * np.arctan(np.tan(0.5 * np.radians(camera.fov_deg)) * camera.height / camera.width)
    node = stock.add(pyrender.PerspectiveCamera(yfov=yfov, aspectRatio=camera.width / camera.height, znear=0.3, zfar=FAR_M))
    offscreen = pyrender.OffscreenRenderer(camera.width, camera.height)

    def draw(pose: FloatArray) -> Frame:
        stock.set_pose(node, _camera_pose(scene, camera, pose))
        return np.asarray(offscreen.render(stock)[0])

    answer = _measure(draw, poses)
    offscreen.delete()
    return answer


def _moderngl(scene: Scene, camera: CameraSpec, poses: FloatArray) -> tuple[float, np.ndarray]:
    """The same picture by the thinnest Python binding: what is left to gain."""
    import moderngl

    context = moderngl.create_context(standalone=True, backend="egl")
    program = context.program(vertex_shader=VERTEX_SHADER, fragment_shader=fragment_shader(camera.grain))
    # No glDepthRange here: the dome is drawn just inside the far plane instead.
    far_sky = replace(
        scene.sky, vertices_m=scene.sky.vertices_m * np.float32(0.97 * FAR_M / DOME_RADIUS_M)
    )  # no glDepthRange here
    arrays = [_vertex_array(context, program, tile) for tile in (*scene.tiles, far_sky)]
    size = (camera.width * camera.supersample, camera.height * camera.supersample)
    target = context.framebuffer([context.renderbuffer(size, 4)], context.depth_renderbuffer(size))
    target.use()
    context.enable(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
    bounds = np.array([[*t.vertices_m[:, :2].min(axis=0), *t.vertices_m[:, :2].max(axis=0)] for t in scene.tiles])
    fine_range_m = FINE_DETAIL_M * camera.focal_px() * camera.supersample
    program["haze"].value = tuple(scene.haze_rgb / 255.0)

    def draw(pose: FloatArray) -> Frame:
        world = _camera_pose(scene, camera, pose)
        eye = world[:3, 3]
        target.clear(depth=1.0)
        program["clip_from_world"].write((projection(camera) @ np.linalg.inv(world)).T.astype(np.float32).tobytes())
        program["eye"].value = tuple(eye)
        program["shift"].value = (0.0, 0.0, 0.0)
        program["extinction"].value = scene.extinction_per_m
        seen, distance_m = visible_tiles(bounds, eye[:2], -world[:2, 2], np.radians(0.5 * camera.fov_deg), FAR_M)
        for i, d in zip(seen, distance_m, strict=True):
            tile = scene.tiles[i]
            arrays[i].render(vertices=3 * (len(tile.faces) if d < fine_range_m else tile.bold_faces))
        program["shift"].value = tuple(eye)
        program["extinction"].value = 0.0
        arrays[-1].render()
        pixels = np.frombuffer(target.read(components=4), dtype=np.uint8).reshape(size[1], size[0], 4)
        reduced = cv2.resize(pixels, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
        return np.ascontiguousarray(reduced[::-1, :, :3])

    answer = _measure(draw, poses)
    context.release()
    return answer


def _vertex_array(context, program, tile: Tile):  # type: ignore[no-untyped-def]
    vertices = np.zeros(len(tile.vertices_m), dtype=VERTEX_DTYPE)
    vertices["position"], vertices["colour"][:, :3], vertices["colour"][:, 3] = tile.vertices_m, tile.rgb, tile.grain
    buffers = context.buffer(vertices.tobytes()), context.buffer(tile.faces.astype(np.uint32).tobytes())
    return context.vertex_array(program, [(buffers[0], "3f 4f1", "position", "colour")], index_buffer=buffers[1])


def _camera_pose(scene: Scene, camera: CameraSpec, pose: FloatArray) -> FloatArray:
    position, yaw = camera_position_m(camera, pose)
    position[:2] -= scene.origin_m
    return camera_to_world(position, yaw)
