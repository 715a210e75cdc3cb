"""One module a format; each has ``CONVENTIONS`` (frames, units, precision) and ``write``, which fills an empty folder."""
