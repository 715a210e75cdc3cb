"""A town to drive in: SUMO, the scene and the ego stepped together, one command and one look at a time."""
