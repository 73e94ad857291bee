"""Real scene on the device: panorama, background, lights, irradiance and highlights."""
