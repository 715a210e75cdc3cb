"""The methods that are compared, and their stages.

Begin with ``method.py``, the table of all methods: what each is called, where its files are, in what frame it is scored.
``stages.py`` runs and times mapping, refinement and localization; ``materials.py`` holds what an evaluation starts from, and
the scores of a trajectory; ``sequences.py`` cuts drives into sequences; ``warm_up.py`` compiles everything before it is timed.
"""
