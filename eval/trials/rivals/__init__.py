"""``hippodrome baselines``: an evaluation with ORB-SLAM3 beside it, a method that needs drives of its own and several runs.

Begin with ``run.py``. ``stage.py`` has the method run on its drives: ``kept.py`` carries one run out and keeps it, ``spread.py``
makes rows of Table I of several, ``saved_map.py`` those of Table II. ``comparison.py`` draws the figures.
"""
