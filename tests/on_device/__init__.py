"""All that is to be known of a device that is there for minutes only: see `__main__`."""
