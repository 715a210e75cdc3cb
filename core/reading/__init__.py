"""Reading the road in single frames: the lane's borders and the line at which it ends."""
