"""Virtual objects on the device: for rays and in the view."""
