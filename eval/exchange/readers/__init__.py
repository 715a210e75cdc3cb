"""One module a format; each has ``read``, which finds frames, self-motion and truth in a folder or file of that format."""
