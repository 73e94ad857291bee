"""Settings of the renderer: their model, defaults, presets and overrides."""
