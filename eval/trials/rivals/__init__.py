"""``hippodrome baselines``: an evaluation with ORB-SLAM3 beside it.

Begin with ``run.py``; ``comparison.py`` draws the figures.
"""
