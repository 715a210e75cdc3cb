"""From a drive that somebody recorded and a map to a page, in one command: ``hippodrome run``.

Begin with ``run.py``, the stages; ``page.py`` makes ``drive.html``.
"""
