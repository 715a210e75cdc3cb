"""The harness: it runs the algorithms of ``core`` on drives of ``sim``, scores them, and is the command line.

Begin with ``evaluate.py``, the story of one scenario, and ``methods/method.py``, the table of all methods. ``run.py`` does the
same for many scenarios over a pool of processes (``pool.py``), and ``cli.py`` with ``commands/`` is what a user types. The
folders, each of which imports only from those before it: ``metrics``, ``files``, ``methods``, ``results``, ``figures``,
``rivals``, ``report``; then ``evaluate.py`` and ``run.py``; and on top of them ``trials``, ``gate``, ``sweep``, ``exchange``,
``authoring``, ``commands``.
"""
