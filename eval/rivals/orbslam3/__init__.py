"""ORB-SLAM3 as a method: a program that is fed stereo pairs over the stream, in an environment of its own.

Begin with ``method.py``, which is what the harness calls; ``runner.py`` is the program, and the only module that imports the
tracker. ``settings.py`` describes the camera to it, ``training.py`` and ``vocabulary.py`` train its vocabulary.
"""
