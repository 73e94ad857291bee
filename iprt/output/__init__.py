"""Output of rendered and measured results: pictures, their metadata, tables of pass times."""
