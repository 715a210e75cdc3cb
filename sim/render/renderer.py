"""Frames of a scene from a vehicle's pose."""

from __future__ import annotations

from types import TracebackType
from typing import Any, ClassVar, Self

import cv2
import numpy as np

from hippodrome.core.types import FloatArray, Frame, HippodromeError, IntArray, UInt8Array
from hippodrome.sim.render.camera import CameraSpec, camera_position_m, camera_to_world
from hippodrome.sim.render.flat import FlatPrimitive, FlatRenderer, LevelCamera
from hippodrome.sim.render.gl import pyrender
from hippodrome.sim.render.vehicles import vehicle_mesh
from hippodrome.sim.scene.types import Scene, Tile

FINE_DETAIL_M = 0.7  # window, sign, lane line: left out where this length covers less than a rendered pixel
NO_POSES = np.zeros((0, 3))
NO_KINDS = np.zeros(0, dtype=np.uint8)


class FlatOffscreenRenderer(pyrender.OffscreenRenderer):  # type: ignore[misc]  # pyrender is untyped
    """pyrender's off-screen context with ``FlatRenderer`` in it."""

    def __init__(self, scene: Scene, camera: CameraSpec) -> None:
        self._drawn, self._camera = scene, camera
        super().__init__(camera.width * camera.supersample, camera.height * camera.supersample)

    def _create(self) -> None:
        super()._create()
        haze = self._drawn.haze_rgb.astype(np.float64) / 255.0
        fine_range_m = FINE_DETAIL_M * self._camera.focal_px() * self._camera.supersample
        extinction, grain = self._drawn.extinction_per_m, self._camera.grain
        self._renderer = FlatRenderer(self.viewport_width, self.viewport_height, haze, extinction, fine_range_m, grain)


class FrameRenderer:
    """Context manager. pyrender's EGL contexts break one another, so a process may have one of these open at a time."""

    _open: ClassVar[FrameRenderer | None] = None

    def __init__(self, scene: Scene, camera: CameraSpec) -> None:
        if FrameRenderer._open is not None:
            raise HippodromeError("a FrameRenderer is open in this process already: close it first, or render in another process")
        self.scene, self.camera = scene, camera
        self._gl_scene, self._camera_node, self._moving = _gl_scene(scene, camera)
        self._offscreen = FlatOffscreenRenderer(scene, camera)
        FrameRenderer._open = self

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Free the GL context; a second call does nothing."""
        if FrameRenderer._open is self:
            FrameRenderer._open = None
            self._offscreen.delete()

    def add_moving(self, tile: Tile) -> FlatPrimitive:
        """Draws another thing with the vehicles from now on; ``replace`` of what is returned changes it."""
        primitive = FlatPrimitive(tile)
        self._gl_scene.add(pyrender.Mesh([primitive]), name="moving")
        return primitive

    def render(
        self,
        pose_m: FloatArray,
        vehicle_poses_m: FloatArray = NO_POSES,
        vehicle_kinds: UInt8Array = NO_KINDS,
        vehicle_ids: IntArray | None = None,
    ) -> Frame:
        """The frame (H, W, 3) seen from body pose (3,), with other vehicles at (k, 3), in the network frame.

        Where roads climb, poses are (5,) and (k, 5): x, y, heading, height [m], pitch [rad, nose up].

        A vehicle keeps its colour as long as it keeps its identity; without ``vehicle_ids`` the row number is the identity.
        """
        self._place_vehicles(vehicle_poses_m, vehicle_kinds, vehicle_ids)
        return self._shoot(pose_m, right_m=0.0)

    def render_stereo(
        self,
        pose_m: FloatArray,
        vehicle_poses_m: FloatArray = NO_POSES,
        vehicle_kinds: UInt8Array = NO_KINDS,
        vehicle_ids: IntArray | None = None,
    ) -> tuple[Frame, Frame]:
        """A rectified pair: left, which equals ``render``'s frame, and right, ``stereo_baseline_m`` beside it."""
        if self.camera.stereo_baseline_m is None:
            raise HippodromeError("camera.stereo_baseline_m is not set: a stereo pair needs a baseline, for instance 0.12")
        left = self.render(pose_m, vehicle_poses_m, vehicle_kinds, vehicle_ids)
        return left, self._shoot(pose_m, right_m=self.camera.stereo_baseline_m)

    def _place_vehicles(self, poses_m: FloatArray, kinds: UInt8Array, ids: IntArray | None) -> None:
        identity = np.arange(len(poses_m), dtype=np.int32) if ids is None else ids
        poses = np.asarray(poses_m, dtype=np.float64)
        local = poses - np.concatenate([self.scene.origin_m, np.zeros(poses.shape[1] - 2)])
        self._moving.replace(vehicle_mesh(local, kinds, identity, self.scene.light))

    def _shoot(self, pose_m: FloatArray, right_m: float) -> Frame:
        position, yaw = camera_position_m(self.camera, np.asarray(pose_m, dtype=np.float64), right_m)
        position[:2] -= self.scene.origin_m
        pitch = float(pose_m[4] * np.cos(np.radians(self.camera.yaw_offset_deg))) if len(pose_m) > 3 else 0.0
        self._gl_scene.set_pose(self._camera_node, camera_to_world(position, yaw, pitch))
        pixels = self._offscreen.render(self._gl_scene)
        size = (self.camera.width, self.camera.height)
        reduced = pixels if self.camera.supersample == 1 else cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
        return np.asarray(cv2.cvtColor(reduced[::-1], cv2.COLOR_RGBA2RGB))  # ten times faster than a slice made contiguous


def _gl_scene(scene: Scene, camera: CameraSpec) -> tuple[Any, Any, FlatPrimitive]:
    """pyrender's scene with every tile added once, its camera node, and the primitive that holds the moving vehicles."""
    gl_scene = pyrender.Scene()
    for i, tile in enumerate(scene.tiles):
        gl_scene.add(pyrender.Mesh([FlatPrimitive(tile)], name=f"{i:06d}"), name="tile")
    gl_scene.add(pyrender.Mesh([FlatPrimitive(scene.sky)]), name="sky")
    moving = FlatPrimitive(vehicle_mesh(NO_POSES, NO_KINDS, np.zeros(0, dtype=np.int32), scene.light))
    gl_scene.add(pyrender.Mesh([moving]), name="moving")
    camera_node = gl_scene.add(LevelCamera(camera))
    return gl_scene, camera_node, moving
