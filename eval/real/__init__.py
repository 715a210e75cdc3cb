"""From a drive that somebody recorded and a map to a page, in one command."""
