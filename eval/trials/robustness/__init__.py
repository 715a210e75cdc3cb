"""``hippodrome robustness``: localization under other conditions than those of the mapping drive.

Begin with ``run``, which runs the trial stage by stage. ``conditions`` says what each condition changes. What is tried is in
``localize`` (unknown starts), ``kidnapping``, ``paper_lengths`` and ``place_recognition``; what came of it in ``sequences``,
``recall`` and ``targets``, gathered in ``findings``; ``tables`` and ``figures`` show it, and ``report`` writes the files.
"""
