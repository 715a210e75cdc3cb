"""The one place that imports pyrender and OpenGL, after the settings that both read at import."""

from __future__ import annotations

import os

import numpy as np

from hippodrome.core.types import HippodromeError

os.environ.setdefault("PYOPENGL_PLATFORM", "egl")  # off-screen without a display server; a user's own choice stays
os.environ.setdefault("LP_NUM_THREADS", "0")  # llvmpipe: parallelism is one process per chunk of the drive, not threads
if not hasattr(np, "infty"):
    setattr(np, "infty", np.inf)  # noqa: B010  # pyrender 0.1.45 was written for numpy 1

try:
    import OpenGL.GL as gl
    import pyrender
    from OpenGL.GL import shaders
except (ImportError, AttributeError, OSError) as error:  # PyOpenGL raises whatever its missing library makes of it
    from hippodrome.sim.render.probe import advice

    raise HippodromeError(f"no off-screen OpenGL: {advice()} ({type(error).__name__}: {error})") from error

__all__ = ["gl", "pyrender", "shaders"]
