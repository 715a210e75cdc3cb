"""``hippodrome gate`` and ``compare``: is this code worse than the code that made the baseline, or another run?

Begin with ``run``, which runs the scenarios and asks. ``baseline`` is the file of figures, ``compare`` the statistics,
``report`` says the verdict. ``power`` tells what the gate would catch; ``two_runs`` shows two results side by side, without a
verdict.
"""
