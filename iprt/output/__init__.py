"""Writing what was rendered and measured: pictures, their metadata, tables of pass times."""
