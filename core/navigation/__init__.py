"""Driving on the vehicle's own map: the plan, the path, the speed, and what to do where the place is in doubt."""
