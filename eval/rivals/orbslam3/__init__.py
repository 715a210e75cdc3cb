"""ORB-SLAM3 on stereo pairs of our drives, in an environment and processes of its own.

Begin with ``stage.py``, which does all of it. ``environment.py`` installs it, ``pairs.py`` draws the stereo pairs,
``training.py`` and ``vocabulary.py`` train its vocabulary, ``settings.py`` describes the camera to it, ``tracker.py`` starts
and feeds ``runner.py``, the only module that imports it. ``poses.py``, ``rows.py`` (Table I) and ``relocalize.py`` (Table II)
make figures of what it leaves.
"""
