"""Programs that are methods: processes with limits, environments of their own, and the ways in which they are given a drive.

``program.py`` writes a drive into a folder (``layouts.py``, ``bags.py``) and reads poses back (``camera_poses.py``);
``stream.py`` feeds a program frame by frame. Both run it by ``process.py``, within ``limits.py``, in namespaces
(``containment.py``) where the system has them, and in an environment of its own (``environments.py``)
if it brings one. ``pairs.py`` draws stereo pairs of a drive for methods that need another camera than the scenario's.
"""
