"""Off-screen frames of a scene, by pyrender with a flat forward pass of our own."""
