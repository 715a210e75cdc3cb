"""What the camera sees: the town's geometry, coloured for the season, the sun and the weather."""
