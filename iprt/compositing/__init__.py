"""The view: the real layer, and its composition with the objects."""
