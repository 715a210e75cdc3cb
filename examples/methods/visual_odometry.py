"""Monocular visual odometry with OpenCV: the turn comes from the frames, the way from the wheels, as one camera has no scale.

hippodrome eval scenarios/towns/grid.yaml --method examples.methods.visual_odometry:VisualOdometry
"""

import math

import cv2
import numpy as np
from pydantic import BaseModel


class VisualOdometry:
    """Corners tracked from frame to frame; their essential matrix gives the turn of the camera."""

    frame = "own"

    class Config(BaseModel):
        """Settings, which a scenario may set: ``methods: {vo: {class: ..., config: {corners: 300}}}``."""

        corners: int = 400
        least: int = 20  # tracked corners; with fewer, the gyro's turn is taken

    def __init__(self, config):
        self.config = config

    def map(self, observations, given):
        """Yield ``(t_s, x, y, heading_rad)`` for each observation."""
        camera = given.camera
        focal_px, centre = camera.focal_px(), (camera.width / 2 - 0.5, camera.height / 2 - 0.5)
        x = y = heading = turned = 0.0  # turned: by the gyro, since the frame before
        before = None
        for one in observations:
            step = one.yaw_rate_radps * one.dt_s
            turned += step
            heading += step
            if one.frame is not None:
                grey = cv2.cvtColor(one.frame, cv2.COLOR_RGB2GRAY)
                seen = None if before is None else self.turn(before, grey, focal_px, centre)
                heading += seen - turned if seen is not None else 0.0
                before, turned = grey, 0.0
            x += one.speed * one.dt_s * math.cos(heading)
            y += one.speed * one.dt_s * math.sin(heading)
            yield one.t_s, x, y, heading

    def turn(self, before, now, focal_px, centre):
        """Turn [rad], counter-clockwise, between two grey frames; None where too little can be tracked."""
        corners = cv2.goodFeaturesToTrack(before, self.config.corners, 0.01, 4)
        if corners is None or len(corners) < self.config.least:
            return None
        moved, found, _ = cv2.calcOpticalFlowPyrLK(before, now, corners, None, winSize=(15, 15))
        kept = found.ravel() == 1
        if kept.sum() < self.config.least:
            return None
        one, other = corners[kept].reshape(-1, 2), moved[kept].reshape(-1, 2)
        cv2.setRNGSeed(1)  # the same frames give the same answer
        essential, inliers = cv2.findEssentialMat(one, other, focal_px, centre, cv2.RANSAC, 0.999, 0.5)
        if essential is None or essential.shape != (3, 3):
            return None
        _, rotation, _, _ = cv2.recoverPose(essential, one, other, focal=focal_px, pp=centre, mask=inliers)
        return float(np.arctan2(rotation[0, 2], rotation[2, 2]))  # about the camera's y axis, which points down
