"""The contest: which methods take part in an evaluation, and each of them run on the same drives.

Begin with ``entry.py``, which makes entries of our own methods, of those of the scenario and of those of the command line;
``perform.py`` runs all entries on one scenario, and ``answers.py`` looks at what they answer before it is scored.
"""
