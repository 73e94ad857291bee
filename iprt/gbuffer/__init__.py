"""Features of a view per pixel, by which image-space passes compare pixels."""
