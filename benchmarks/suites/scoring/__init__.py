"""How the stress suite is read, scored and reported."""
