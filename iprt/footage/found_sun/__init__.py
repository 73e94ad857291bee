"""Search for a sun that the panorama does not show."""
