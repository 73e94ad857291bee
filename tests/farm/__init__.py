"""Films rendered on many machines."""
